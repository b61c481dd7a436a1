"""A hash over all numbers of a robot, so that a changed file is noticed."""

from __future__ import annotations

import hashlib
from dataclasses import fields

import numpy as np

from wbc.robot.robot import Robot


def fingerprint(robot: Robot) -> str:
    """Return a hash over bodies, joints, gears, contacts, sensors and effects of a robot."""
    model, gears = robot.model, robot.transmission
    parts = [np.asarray(model.gravity.linear)]
    for joint in range(1, model.njoints):
        parts.append(np.asarray(model.inertias[joint].toDynamicParameters()))
        parts.append(np.asarray(model.jointPlacements[joint].homogeneous))
    numbers = [getattr(gears, field.name) for field in fields(gears)]
    parts += [values for values in numbers if isinstance(values, np.ndarray)]
    parts += [np.asarray([*contact.offset, contact.friction]) for contact in robot.contacts]
    texts = [
        *model.names,
        *(contact.name for contact in robot.contacts),
        *gears.joints,
        *gears.housings,
        *robot.torque_sensors,
        "sensors alone",
        *robot.sensor_only,
        *(f"{e.name} at {e.where}: {sorted(e.values.items())}" for e in robot.effects),
    ]
    digest = hashlib.sha256("|".join(texts).encode("utf-8"))
    for part in parts:
        digest.update(np.ascontiguousarray(part, dtype=np.float64).tobytes())
    return digest.hexdigest()
