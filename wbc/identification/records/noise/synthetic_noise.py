"""What white sensor noise of the measured level does to a residual."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque
from wbc.identification.records.outputs import output_count
from wbc.identification.records.record import Record
from wbc.measurement import derivative, low_pass


def _disturbed(
    model: pin.Model, positions: FloatArray, position: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Return what errors (N, nv) of position and acceleration change in the links' torque.

    Positions enter through gravity, accelerations through inertia; speeds matter little.
    """
    data = model.createData()
    at_rest = np.zeros(model.nv)
    torque = np.empty(position.shape)
    for row, (q, error) in enumerate(zip(positions, position, strict=True)):
        here = pin.rnea(model, data, q, at_rest, at_rest).copy()
        there = pin.rnea(model, data, pin.integrate(model, q, error), at_rest, acceleration[row])
        torque[row] = there - here
    return torque


def synthetic_noise(record: Record, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Return drawn noise (N, m + b + s) of the reported torque, and of what the model needs.

    Positions, velocities, torques and forces get white noise of the level found in the log, the
    same filters, and the model's mass matrix and contact Jacobians.

    Args:
        record: one log.
        seed: of what is drawn.
    """
    robot, rate, noise = record.robot, record.rate, record.noise
    random = np.random.default_rng(seed)
    count = len(record.motion.velocity)
    cutoff = record.bandwidth.kinematics

    def white(level: FloatArray) -> FloatArray:
        sigma = np.sqrt(np.maximum(np.nan_to_num(level), 0.0) * 0.5 * rate)
        return low_pass(sigma * random.standard_normal((count, level.size)), cutoff, rate)

    position = np.nan_to_num(white(noise.position))
    measured = noise.measures_speed(record.bandwidth)
    velocity = np.where(measured, white(noise.velocity), derivative(position, rate))
    acceleration = derivative(velocity, rate)
    torque = _disturbed(record.model_of(robot), record.motion.position, position, acceleration)
    forces = {name: white(level) for name, level in noise.forces.items()}
    torque -= contact_torque(robot, record.motion.position, forces)
    gears = robot.transmission
    balance = record.balance
    if balance is not None:
        torque -= balance.carried(torque[:, robot.unactuated])
    mesh = torque[:, robot.actuated] @ gears.topology
    sensed = white(noise.sensed)
    behind = sensed - mesh[:, robot.sensed]
    mesh[:, robot.sensed] = sensed
    spin = acceleration[:, robot.actuated] @ gears.motor_from_joint.T
    needed = np.sign(gears.gear_ratio) * mesh + np.abs(gears.gear_ratio) * (
        gears.rotor_inertia * gears.gear_ratio * spin
    )
    reported = np.zeros((count, output_count(robot)))
    reported[:, : gears.size] = white(noise.torque)
    if balance is not None:
        sign = np.sign(gears.gear_ratio)
        needed = sign * balance.seen(sign * needed)
        reported[:, : gears.size] = sign * balance.seen(sign * reported[:, : gears.size])
    rows = [-needed, -torque[:, robot.unactuated], behind]
    return reported, np.concatenate(rows, axis=1)
