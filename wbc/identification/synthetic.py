"""What white sensor noise of the measured level does to a residual."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque
from wbc.identification.record import Record
from wbc.identification.smoothing import derivative, low_pass


def synthetic_noise(record: Record) -> tuple[FloatArray, FloatArray]:
    """Return drawn noise (N, m + b) of the reported torque, and of what the model needs.

    Positions, velocities, torques and forces get white noise of the level found in the log, the
    same filters, and the model's mass matrix and contact Jacobians.
    """
    robot, rate, noise = record.robot, record.rate, record.noise
    random = np.random.default_rng(0)
    count, nv = record.motion.velocity.shape
    cutoff = record.bandwidth.kinematics

    def white(level: FloatArray) -> FloatArray:
        sigma = np.sqrt(np.maximum(np.nan_to_num(level), 0.0) * 0.5 * rate)
        return low_pass(sigma * random.standard_normal((count, level.size)), cutoff, rate)

    by_position, by_velocity = noise.acceleration_variance(record.bandwidth.residual)
    quieter = by_velocity < np.where(np.isfinite(by_position), by_position, np.inf)
    velocity = np.where(quieter, white(noise.velocity), derivative(white(noise.position), rate))
    acceleration = derivative(velocity, rate)
    torque = np.empty((count, nv))
    data = robot.model.createData()
    for row, q in enumerate(record.motion.position):
        torque[row] = pin.crba(robot.model, data, q) @ acceleration[row]
    forces = {name: white(level) for name, level in noise.forces.items()}
    torque -= contact_torque(robot, record.motion.position, forces)
    gears = robot.transmission
    mesh = torque[:, robot.actuated] @ gears.topology
    spin = acceleration[:, robot.actuated] @ gears.motor_from_joint.T
    needed = np.sign(gears.gear_ratio) * mesh + np.abs(gears.gear_ratio) * (
        gears.rotor_inertia * gears.gear_ratio * spin
    )
    reported = np.zeros((count, gears.size + robot.floating_size))
    reported[:, : gears.size] = white(noise.torque)
    return reported, -np.concatenate([needed, torque[:, robot.unactuated]], axis=1)
