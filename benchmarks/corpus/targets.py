"""Logs of a case as position drives give them: targets in place of torques."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.flaws import per_joint
from wbc.measurement import Log, rotor_torques
from wbc.robot import Robot

_LEAD = 0.05  # [rad] rms by which a target leads its joint: a stiff drive of a small robot
_DAMPING = 0.02  # [s], velocity gain over position gain


def with_targets(case: Case, robot: Robot, logs: Sequence[Log]) -> tuple[Robot, list[Log]]:
    """Return the robot with gains, and its logs with the targets that make the reported torques.

    The drive makes kp (target - psi) - kd dpsi of what its encoder shows at the motor's output. A
    late torque is a target that arrives late: the drive's own measurement does not.
    """
    gears = robot.transmission
    torques = [rotor_torques(log, gears) * gears.gear_ratio for log in logs]
    size = np.sqrt(np.mean(np.concatenate(torques) ** 2, axis=0))
    stiffness = np.maximum(size, 0.05 * size.max()) / _LEAD
    speeds = all(log.has(f"{joint}.velocity") for log in logs for joint in gears.joints)
    damping = _DAMPING * stiffness if speeds else 0.0 * stiffness
    delay = per_joint(case.machine, case.flaws, "actuation_delay", "delay", 0.0)
    found = []
    for log, torque in zip(logs, torques, strict=True):
        position = log.stack("position", gears.joints) @ gears.motor_from_joint.T
        target = np.empty_like(position)
        turning = np.zeros_like(position)
        if speeds:
            turning = log.stack("velocity", gears.joints) @ gears.motor_from_joint.T
        for k, late in enumerate(delay):
            given = np.interp(log.time - late, log.time, torque[:, k])
            arrived = position[:, k] + (given + damping[k] * turning[:, k]) / stiffness[k]
            target[:, k] = np.interp(log.time + late, log.time, arrived)
        told = target @ gears.topology.T
        kept = {n: v for n, v in log.columns.items() if not n.endswith(".rotor_torque")}
        kept |= {f"{j}.target_position": told[:, k] for k, j in enumerate(gears.joints)}
        found.append(Log(log.time, kept, log.source))
    gains = gears.replace(position_gain=stiffness, velocity_gain=damping)
    return robot.with_transmission(gains), found
