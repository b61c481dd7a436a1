"""The acceleration of a robot at rest under the set-valued mesh law, exact in every direction.

From rest the acceleration x of a gear's output plays the part of its speed: with t = U - N^2 I_r x
the gear puts out T = min(eta_f t, t/eta_b) where x > 0, T = max(...) where x < 0, and anything
between eta_f U and U/eta_b where x = 0 (the mesh law of docs/method/physics.md). T falls as x
grows, so that M x + r = T has one solution for every gear, whatever direction the power takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError
from wbc.metrics.contact_task import ContactTask

_LEAST_BACKWARD = (
    1e-9  # eta_b of a self-locking gear: the limit eta_b -> 0, as test_metrics_inertia
)
_SWEEPS = 2000  # bound only: measured 10 to 60 on the shipped robots, a serial arm of six axes 200
_CLOSE = 1e-12  # relative change per sweep at which the states of the gears are read off


@dataclass(frozen=True, eq=False)
class RestResponse:
    """How a robot starts from rest under k sets of torques and forces.

    Attributes:
        acceleration: (nv, k).
        output: accelerations (m, k) of the motor outputs, exactly 0 where friction holds a gear.
        mesh: torque t (m, k) [N m] that each rotor gives to its mesh.
    """

    acceleration: FloatArray
    output: FloatArray
    mesh: FloatArray


def rest_response(task: ContactTask, motor: FloatArray, external: FloatArray) -> RestResponse:
    """Return the accelerations from rest; gravity is left out.

    Args:
        task: contact point and pose; only its robot and terms are used.
        motor: U (m, k) [N m], rotor torques times the gear ratio.
        external: joint-space forces (nv, k).

    Raises:
        DynamicsError: rotors that couple inertially with the links, or rotors without inertia in a
            gear that nothing else stops (no unique solution).
    """
    robot, terms = task.robot, task.terms
    if robot.rotors_turn_with_links:
        raise DynamicsError(
            f"'{robot.name}' couples rotors and links inertially; the exact response leaves that "
            "out. Load it without rotors_turn_with_links."
        )
    gears, driven, rest = robot.transmission, robot.actuated, robot.unactuated
    H = terms.mass_matrix
    # Only the undriven coordinates are eliminated: a driven link may have no inertia of its own
    # (a drawn wrist), its rotor has some.
    held = np.linalg.solve(H[np.ix_(rest, rest)], H[np.ix_(rest, driven)])
    pulled = np.linalg.solve(H[np.ix_(rest, rest)], external[rest])
    joint_from_motor = np.linalg.inv(gears.motor_from_joint)
    M = joint_from_motor.T @ (H[np.ix_(driven, driven)] - H[np.ix_(driven, rest)] @ held)
    M = M @ joint_from_motor
    drift = joint_from_motor.T @ (external[driven] - H[np.ix_(driven, rest)] @ pulled)
    forward = gears.forward_efficiency[:, None]
    backward = np.maximum(gears.backward_efficiency, _LEAST_BACKWARD)[:, None]
    moved = _gear_acceleration(M, drift, motor, gears.reflected_inertia[:, None], forward, backward)
    acceleration = np.zeros_like(external)
    acceleration[driven] = joint_from_motor @ moved
    acceleration[rest] = pulled - held @ acceleration[driven]
    return RestResponse(acceleration, moved, motor - gears.reflected_inertia[:, None] * moved)


def _gear_acceleration(
    M: FloatArray,
    drift: FloatArray,
    motor: FloatArray,
    rotor: FloatArray,
    forward: FloatArray,
    backward: FloatArray,
) -> FloatArray:
    """Return x (m, k) with M x - drift in the set T(x), row by row in turn (a convex program)."""
    x = np.zeros_like(motor)
    for _ in range(_SWEEPS):
        before = x.copy()
        for i in range(len(x)):
            r = M[i] @ x - M[i, i] * x[i] - drift[i]
            one = (forward[i] * motor[i] - r) / (M[i, i] + forward[i] * rotor[i])
            # Multiplied by eta_b, which may be tiny.
            other = (motor[i] - backward[i] * r) / (backward[i] * M[i, i] + rotor[i])
            low, high = np.minimum(one, other), np.maximum(one, other)
            x[i] = np.maximum(low, 0.0) + np.minimum(high, 0.0)
        if np.all(np.abs(x - before) <= _CLOSE * np.abs(x).max(axis=0)):
            break
    return _polished(M, drift, motor, rotor, forward, backward, x)


def _polished(
    M: FloatArray,
    drift: FloatArray,
    motor: FloatArray,
    rotor: FloatArray,
    forward: FloatArray,
    backward: FloatArray,
    x: FloatArray,
) -> FloatArray:
    """Return x from one linear solve per column, each gear in the state that the sweeps found."""
    t = motor - rotor * x
    eta = np.where(t * x >= 0.0, forward, 1.0 / backward)
    solved = np.zeros_like(x)
    for k in range(x.shape[1]):
        go = np.flatnonzero(x[:, k])
        left = M[np.ix_(go, go)] + np.diag((eta * rotor)[go, k])
        solved[go, k] = np.linalg.solve(left, eta[go, k] * motor[go, k] + drift[go, k])
    return solved
