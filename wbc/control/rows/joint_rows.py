"""Bounds on the accelerations of joints, from their stops, speeds and motors, compiled."""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Any

import numpy as np
from numba import types

from wbc.arrays import FloatArray
from wbc.compiled import Nothing, Number, OutRow, Places, Row, Vector, compiled
from wbc.control.qp.gear_rows import GEARS
from wbc.structures import Structure

JOINTS = Structure(
    "Joints",
    rows=Places,
    positions=Places,
    lower=Row,
    upper=Row,
    speed=Row,
    acceleration=Row,
    torque=Row,
    reflected=Row,
    least=Row,
    load=OutRow,
)
"""Limits of joints (k,): where they stand in v and q, stops, greatest speed and acceleration.

What motors do about it: `torque` (k,) [N m] holds a joint back at most, infinite where nothing is
known to limit it, `reflected` (k,) is the inertia of the rotors then, `least` (k,) a deceleration
to count on; `load` (nv,) is the torque on the coordinates less M qdd of the last tick, NaN where
there was none, (0,) where nobody asks.
"""

_MOST = 1e9
"""[rad/s^2] that brakes without a limit are taken to give: within a tick whatever is needed."""


@compiled(Number, *[Number] * 4)
def viable(distance: float, speed: float, braking: float, dt: float) -> float:
    """Return the acceleration towards a stop after which a joint can still stop before it.

    The larger root a of (v + h a)^2 = 2 b (d - h v - h^2 a/2); braking in full where none is left.
    """
    if distance == np.inf:
        return np.inf
    reach = braking * dt
    root = reach * reach + 8.0 * braking * distance - 4.0 * reach * speed
    if root < 0.0:
        return -braking
    found: float = (sqrt(root) - 2.0 * speed - reach) / (2.0 * dt)
    return found


@compiled(Nothing, JOINTS.kind, *[Vector] * 2, Number, *[Row] * 2, types.UniTuple(OutRow, 2))
def place_bounds(
    joints: Any,
    position: FloatArray,
    velocity: FloatArray,
    dt: float,
    up: FloatArray,
    down: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
) -> None:
    """Write the least and greatest acceleration of joints, see `JointLimit`.

    Args:
        joints: JOINTS.
        position, velocity, dt: q (nq,), v (nv,), [s] until the next decision.
        up, down: what the motors can brake (k,), of motion upwards and downwards.
        bounds: results (>= k,).
    """
    for k in range(len(joints.rows)):
        q, v, most = position[joints.positions[k]], velocity[joints.rows[k]], joints.acceleration[k]
        high, low = min(most, up[k], _MOST), min(most, down[k], _MOST)
        rise = viable(joints.upper[k] - q, v, high, dt)
        fall = viable(q - joints.lower[k], -v, low, dt)
        highest = min(max(min((joints.speed[k] - v) / dt, rise), -high), most)
        lowest = max(min(-min((joints.speed[k] + v) / dt, fall), low), -most)
        bounds[0][k], bounds[1][k] = min(lowest, highest), max(lowest, highest)


@compiled(Nothing, JOINTS.kind, GEARS.kind, OutRow, OutRow)
def place_braking(joints: Any, gears: Any, up: FloatArray, down: FloatArray) -> None:
    """Write the deceleration (k,) of motion upwards and downwards, see `MotorBraking`."""
    for k in range(len(joints.rows)):
        up[k], down[k] = np.inf, np.inf
        if not isfinite(joints.torque[k]):
            continue
        row = joints.rows[k]
        load = joints.load[row]
        if not isfinite(load):
            load = gears.bias[row]
        whole = gears.mass[row, row] + joints.reflected[k]
        up[k] = max((joints.torque[k] + load) / whole, joints.least[k])
        down[k] = max((joints.torque[k] - load) / whole, joints.least[k])


@compiled(Nothing, JOINTS.kind, GEARS.kind, *[Vector] * 2, Number, types.UniTuple(OutRow, 2))
def place_joint_bounds(
    joints: Any,
    gears: Any,
    position: FloatArray,
    velocity: FloatArray,
    dt: float,
    bounds: tuple[FloatArray, FloatArray],
) -> None:
    """Write the least and greatest acceleration of joints with what their motors can brake now."""
    count = len(joints.rows)
    up, down = np.empty(count), np.empty(count)
    place_braking(joints, gears, up, down)
    place_bounds(joints, position, velocity, dt, up, down, bounds)
