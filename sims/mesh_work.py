"""What motors do and what their gears lose on a recorded way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc import Robot
from wbc.arrays import FloatArray
from wbc.view.channels import gear_powers, tooth_loss


class MeshWork(NamedTuple):
    """Mean powers on a way [W].

    Attributes:
        driving: of the motors while they drive; what they take back counts as lost.
        lost: in the mesh of each gear (m,).
    """

    driving: float
    lost: FloatArray


def mesh_work(robot: Robot, velocity: FloatArray, torque: FloatArray, tick: float) -> MeshWork:
    """Return the mean powers of velocities (n, nv) under rotor torques (n, m), a tick [s] apart."""
    gears = robot.transmission
    speed = velocity[:, robot.actuated] @ gears.motor_from_joint.T
    mesh, _ = gear_powers(gears, torque, speed, np.gradient(speed, tick, axis=0))
    driving = np.maximum(gears.gear_ratio * torque * speed, 0.0).sum(axis=1).mean()
    return MeshWork(float(driving), tooth_loss(gears, mesh).mean(axis=0))
