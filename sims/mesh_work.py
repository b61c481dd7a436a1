"""What motors do and what their gears lose on a recorded way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc import Robot
from wbc.arrays import FloatArray


class MeshWork(NamedTuple):
    """Mean powers on a way [W].

    Attributes:
        driving: of the motors while they drive; what they take back counts as lost.
        lost: in the mesh of each gear (m,).
    """

    driving: float
    lost: FloatArray


def mesh_work(robot: Robot, velocity: FloatArray, torque: FloatArray, tick: float) -> MeshWork:
    """Return the mean powers of velocities (n, nv) under rotor torques (n, m), a tick [s] apart.

    The mesh torque is what the motor gives beyond its rotor's inertia; the teeth keep
    t (1 - eta_f) of it where the motor drives and |t| (1/eta_b - 1) where the joint does.
    """
    gears = robot.transmission
    speed = velocity[:, robot.actuated]
    given = gears.gear_ratio * torque
    mesh = given - gears.reflected_inertia * np.gradient(speed, tick, axis=0)
    kept = np.where(
        mesh * speed > 0.0, 1.0 - gears.forward_efficiency, 1.0 / gears.backward_efficiency - 1.0
    )
    lost = (np.abs(mesh * speed) * kept).mean(axis=0)
    return MeshWork(float(np.maximum(given * speed, 0.0).sum(axis=1).mean()), lost)
