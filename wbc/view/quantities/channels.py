"""What a picture needs from a log; unlike an estimate it makes do with what is there."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.measurement import Log, joint_position
from wbc.robot import Robot


def configuration(robot: Robot, log: Log) -> FloatArray:
    """Return q (N, nq); a joint that the log does not mention stays at its neutral position.

    Where only a velocity was recorded its integral stands for the position.

    Raises:
        LogError: the log holds the position of no joint of the robot.
    """
    position = np.tile(robot.neutral(), (len(log), 1))
    found = False
    for name in robot.single_joints:
        if log.has(f"{name}.position") or log.has(f"{name}.velocity"):
            position[:, robot.position_index(name)] = joint_position(log, name)
            found = True
    base = [f"base.position.{axis}" for axis in "xyz"]
    turn = [f"base.orientation.{axis}" for axis in "xyzw"]
    if robot.has_free_flyer and log.has(*base, *turn):
        position[:, :3] = np.stack([log.column(name) for name in base], axis=1)
        quaternion = np.stack([log.column(name) for name in turn], axis=1)
        position[:, 3:7] = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
        found = True
    if not found:
        some = [f"{joint}.position" for joint in robot.single_joints[:4]]
        names = ", ".join(some) + (", ..." if len(robot.single_joints) > 4 else "")
        raise LogError(
            f"{log.source.label}: no position of any joint of '{robot.name}'; expected {names}."
        )
    return position


def velocity(robot: Robot, log: Log) -> FloatArray:
    """Return v (N, nv): measured where the log has it, else the difference of the positions."""
    result = np.zeros((len(log), robot.model.nv))
    for name in robot.single_joints:
        row = robot.velocity_index(name)
        if log.has(f"{name}.velocity"):
            result[:, row] = log.column(f"{name}.velocity")
        elif log.has(f"{name}.position"):
            result[:, row] = np.gradient(log.column(f"{name}.position"), log.time)
    parts = [f"base.{kind}_velocity.{axis}" for kind in ("linear", "angular") for axis in "xyz"]
    if robot.has_free_flyer and log.has(*parts):
        result[:, :6] = np.stack([log.column(part) for part in parts], axis=1)
    return result


def rotor_torque(robot: Robot, log: Log) -> FloatArray:
    """Return the torque on the rotors (N, m) [N m]; NaN columns where the log holds none."""
    gears = robot.transmission
    torque = np.full((len(log), gears.size), np.nan)
    for column, joint in enumerate(gears.joints):
        if log.has(f"{joint}.rotor_torque"):
            torque[:, column] = log.column(f"{joint}.rotor_torque")
        elif log.has(f"{joint}.motor_torque"):
            torque[:, column] = log.column(f"{joint}.motor_torque") / gears.gear_ratio[column]
        elif log.has(f"{joint}.current"):
            torque[:, column] = log.column(f"{joint}.current") * gears.torque_constant[column]
    return torque


def contact_forces(robot: Robot, log: Log) -> dict[str, FloatArray]:
    """Return contact name -> force of the ground on the robot (N, 3) [N], world axes."""
    forces = {}
    for contact in robot.contacts:
        axes = [f"{contact.name}.force.{axis}" for axis in "xyz"]
        if not any(log.has(axis) for axis in axes):
            continue
        forces[contact.name] = np.stack(
            [log.column(axis) if log.has(axis) else np.zeros(len(log)) for axis in axes], axis=1
        )
    return forces
