"""Inertial coupling of rotor spin and housing motion inside a step.

The rotor's momentum is I_r (phi_dot + a'J_omega v), so a change of v asks the impulse N C dv of
the rotor (at the motor output, C = I_r a'J_omega) and a change of its spin asks C' N dw of the
links. Both are taken from the last iterate; the iteration contracts by about the share of rotor
in link inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import Terms, Workspace, rotor_coupling
from wbc.robot import Robot

COUPLING_ROUNDS = 60
COUPLING_TOLERANCE = 1e-13
COUPLING_FAILED = (
    "the inertial coupling of rotors and housings did not settle: a rotor is about as heavy as the "
    "links that carry it. Model it as a joint of its own."
)


@dataclass(frozen=True, eq=False, slots=True)
class StepCoupling:
    """Coupling at the middle of a step.

    Attributes:
        inertia: N C (m, nv) [kg m^2].
        link_bias: (nv,) gyroscopic torque on the links.
        rotor_bias: N times that on the rotors (m,).
    """

    inertia: FloatArray
    link_bias: FloatArray
    rotor_bias: FloatArray


def step_coupling(
    robot: Robot, space: Workspace, position: FloatArray, velocity: FloatArray
) -> StepCoupling | None:
    """Return the coupling at (q, v); None where rotors only feel their own spin."""
    if not robot.rotors_turn_with_links:
        return None
    model, data = space.model, space.data
    pin.forwardKinematics(model, data, position, velocity, np.zeros(model.nv))
    pin.computeJointJacobians(model, data, position)
    none = np.zeros(0)
    terms = Terms(position, velocity, none, none, none, none, none, data)
    found = rotor_coupling(robot, terms)
    ratio = robot.transmission.gear_ratio
    return StepCoupling(ratio[:, None] * found.inertia, found.link_bias, ratio * found.rotor_bias)
