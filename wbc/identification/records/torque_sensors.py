"""Torque sensors behind gears: who has one in all logs, and which rows say nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from wbc.errors import LogError
from wbc.identification.records.outputs import output_count
from wbc.identification.records.record import Record
from wbc.measurement import Log
from wbc.robot import Robot

_HIDDEN = 1e-9  # share of a row that is seen, below which only rounding is left


def sensed_joints(robot: Robot, logs: Sequence[Log]) -> tuple[str, ...]:
    """Return the driven joints with `<joint>.joint_torque` in all logs.

    Raises:
        LogError: a joint of whose drive nothing else is known lacks it.
    """
    for log in logs:
        for joint in robot.sensor_only:
            if not log.has(f"{joint}.joint_torque"):
                raise LogError(
                    f"{log.source.label}: '{robot.name}' describes no gear of '{joint}' but a "
                    f"torque sensor, so the log needs '{joint}.joint_torque'."
                )
    joints = robot.transmission.joints
    return tuple(j for j in joints if all(log.has(f"{j}.joint_torque") for log in logs))


def without_torque_sensors(robot: Robot, logs: Sequence[Log]) -> list[Log]:
    """Return the logs as drives alone tell them, where they tell anything.

    Args:
        robot: that the logs are held against.
        logs: as recorded.
    """
    spared = {f"{joint}.joint_torque" for joint in robot.transmission.joints}
    spared -= {f"{joint}.joint_torque" for joint in robot.sensor_only}
    return [
        replace(log, columns={n: v for n, v in log.columns.items() if n not in spared})
        for log in logs
    ]


def not_judged(records: Sequence[Record]) -> tuple[int, ...]:
    """Return the outputs that say nothing.

    Drives without a report, links that are not described, and a base that touches all the time at
    contacts without force sensors: their forces are what its balance asks for.
    """
    drives = np.flatnonzero(~np.all([record.reported for record in records], axis=0))
    shares = [r.balance.seen_share if r.balance is not None else np.inf for r in records]
    balanced = np.max(np.broadcast_arrays(*shares, np.zeros(1)), axis=0) < _HIDDEN
    carried = np.flatnonzero(balanced) if balanced.size > 1 else drives[:0]
    return (*map(int, drives), *map(int, carried), *without_links(records[0].robot))


def without_links(robot: Robot) -> tuple[int, ...]:
    """Return the outputs behind the sensors of joints that carry no mass.

    What stands there the robot does not describe, such as the other motor of a dynamometer.
    """
    first = output_count(robot) - len(robot.torque_sensors)
    data = robot.model.createData()
    pin.computeSubtreeMasses(robot.model, data)
    return tuple(
        first + k
        for k, joint in enumerate(robot.torque_sensors)
        if data.mass[robot.model.getJointId(joint)] <= 0.0
    )
