"""The dissipative equation of motion, reduced to the joints (Sim & Ramos, section IV)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics.redundant import redundant_model
from wbc.dynamics.terms import Terms
from wbc.robot import Robot
from wbc.transmission import efficiency


@dataclass(frozen=True, eq=False)
class DissipativeEquation:
    """inertia @ qdd + bias = J' f_ext + actuation @ tau_phi for fixed directions of power.

    Attributes:
        inertia: K' E_s H_s K (nv, nv); symmetric only without rotor-link coupling.
        bias: K' E_s c_s (nv,).
        actuation: [0; B E_m] (nv, m), columns per rotor.
        directions: (m,), +1 forward, -1 backward, 0 as without losses.
    """

    inertia: FloatArray
    bias: FloatArray
    actuation: FloatArray
    directions: FloatArray

    @cached_property
    def inverse_inertia(self) -> FloatArray:
        """Inverse of `inertia`, (nv, nv)."""
        return np.asarray(np.linalg.inv(self.inertia))

    def acceleration(self, rotor_torque: FloatArray, external: FloatArray) -> FloatArray:
        """Return qdd (nv,) under rotor torques (m,) and an external joint-space force (nv,)."""
        force = external + self.actuation @ rotor_torque - self.bias
        return np.asarray(self.inverse_inertia @ force)


def dissipative_equation(robot: Robot, terms: Terms, directions: FloatArray) -> DissipativeEquation:
    """Return the dissipative equation of motion (Sim & Ramos, section IV) as the paper states it.

    Args:
        robot: the robot.
        terms: its terms at a state.
        directions: (m,) +1 where the mesh power runs forward, -1 backward, 0 without loss.

    Raises:
        TransmissionError: a self-locking gear called backward.
    """
    gears = robot.transmission
    model = redundant_model(robot, terms)
    eta = efficiency(directions, gears.forward_efficiency, gears.backward_efficiency)
    nv = robot.model.nv
    weighted = model.nullspace.copy()
    weighted[nv:] *= eta[:, None]
    actuation = np.zeros((nv, gears.size))
    actuation[robot.actuated] = gears.distribution * eta
    return DissipativeEquation(
        inertia=weighted.T @ model.inertia @ model.nullspace,
        bias=weighted.T @ model.bias,
        actuation=actuation,
        directions=np.asarray(directions, dtype=np.float64),
    )
