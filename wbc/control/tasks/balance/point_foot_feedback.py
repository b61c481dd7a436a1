"""The feedback that balances a robot on a point foot, compiled."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import Matrix, Number, Vector, compiled
from wbc.control.solvers.positive_definite import factorise, substitute


@compiled(types.UniTuple(Number, 2), *[Matrix] * 4)
def pitch_rate(
    foot: FloatArray, com: FloatArray, momentum: FloatArray, frame: FloatArray
) -> tuple[float, float]:
    """Return a and c of dtheta/dt = a xd + c k for the smallest motion with a resting foot.

    Both are NaN where the foot cannot rest.

    Args:
        foot, frame: Jacobians (6, nv) of the foot, whose x and z rest, and of the frame.
        com: Jacobian (3, nv) of the centre of mass, of which x and z count.
        momentum: centroidal momentum matrix (6, nv), of which the pitch row counts.
    """
    nv = foot.shape[1]
    rows, normal, weights = np.empty((5, nv)), np.empty((5, 5)), np.empty(5)
    for j in range(nv):
        rows[0, j], rows[1, j] = foot[0, j], foot[2, j]
        rows[2, j], rows[3, j] = com[0, j], com[2, j]
        rows[4, j] = momentum[4, j]
    for i in range(5):
        weights[i] = 0.0
        for j in range(nv):
            weights[i] += rows[i, j] * frame[4, j]
        for k in range(i + 1):
            normal[i, k] = 0.0
            for j in range(nv):
                normal[i, k] += rows[i, j] * rows[k, j]
        normal[i, i] += 1e-12
    if not factorise(normal, 5):
        return np.nan, np.nan
    substitute(normal, 5, weights)
    return weights[2], weights[4]


@compiled(Number, *[Matrix] * 4, *[Vector] * 3, *[Number] * 4)
def balancing(
    foot: FloatArray,
    com: FloatArray,
    momentum: FloatArray,
    frame: FloatArray,
    foot_place: FloatArray,
    com_place: FloatArray,
    velocity: FloatArray,
    mass: float,
    gravity: float,
    bandwidth: float,
    pitch: float,
) -> float:
    """Return xdd [m/s^2], the feedback on (x, xd, k, theta) with all poles at -p.

    With u = xdd, G = m g and Z = m z the loop's polynomial is

        s^4 + (k2 - Z k3) s^3 + (k1 + (a - c Z) k4) s^2 + G k3 s + c G k4 = (s + p)^4.

    Args:
        foot, com, momentum, frame: as for `pitch_rate`.
        foot_place, com_place: of foot and centre of mass (3,) [m].
        velocity: v (nv,).
        mass, gravity: m [kg] and g [m/s^2].
        bandwidth: p [1/s], or 0 for that of the pendulum's fall, sqrt(g/z).
        pitch: theta that is missing [rad].
    """
    from_speed, from_momentum = pitch_rate(foot, com, momentum, frame)
    place, height = com_place[0] - foot_place[0], com_place[2] - foot_place[2]
    speed, spin = 0.0, 0.0
    for j in range(len(velocity)):
        speed += com[0, j] * velocity[j]
        spin += momentum[4, j] * velocity[j]
    pole = bandwidth if bandwidth > 0.0 else sqrt(gravity / abs(height))
    square = pole * pole
    on_pitch = square * square / (from_momentum * mass * gravity)
    on_spin = 4.0 * square * pole / (mass * gravity)
    on_speed = 4.0 * pole + mass * height * on_spin
    on_place = 6.0 * square - (from_speed - from_momentum * mass * height) * on_pitch
    wanted: float = on_pitch * pitch - on_place * place - on_speed * speed - on_spin * spin
    return wanted
