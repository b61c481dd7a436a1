"""A scene written down for peers, which read it in processes of their own."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pinocchio as pin

from benchmarks.controller_scenes import (
    COM_WEIGHT,
    FRICTION,
    POSTURE_WEIGHT,
    STIFFNESS,
    TRUNK,
    TRUNK_WEIGHT,
    URDF,
)
from wbc.control import JointLimit


def write_scene(robot, states, folder):
    """Write what a peer needs to know of a scene as JSON into a folder; return the file."""
    prefix = Path(pin.__file__).resolve().parents[4] / "share" / "example-robot-data"
    flat = robot.name == "talos"
    frame_of = {contact.name: contact.frame for contact in robot.contacts}
    if flat:
        frame_of |= {side: frame_of[f"{side}_sole_front_left"] for side in ("left", "right")}
    feet = sorted({contact.frame for contact in robot.contacts})
    gears, limit = robot.transmission, JointLimit.of(robot)
    description = {
        "urdf": str(without_meshes(prefix / "robots" / URDF[robot.name], Path(folder))),
        "joints": list(robot.joints[1:]),
        "positions": [tick.motion.position.tolist() for tick in states],
        "velocities": [tick.motion.velocity.tolist() for tick in states],
        "com": [tick.com.tolist() for tick in states],
        "active": [
            feet if tick.contacts is None else sorted(frame_of[name] for name in tick.contacts)
            for tick in states
        ],
        "stiffness": STIFFNESS,
        "com_weight": COM_WEIGHT,
        "trunk_weight": TRUNK_WEIGHT,
        "posture_weight": POSTURE_WEIGHT,
        "trunk": TRUNK[robot.name],
        "feet": feet,
        "flat": flat,
        "sole": [0.21, 0.13],
        "friction": 0.7,
        "weight": 9.81 * pin.computeTotalMass(robot.model),
        "lower": limit.lower.tolist(),
        "upper": limit.upper.tolist(),
        "speed": limit.speed.tolist(),
        "dry": FRICTION,
        "torque_limit": (gears.gear_ratio * gears.torque_limit).tolist(),
    }
    path = Path(folder) / f"{robot.name}.json"
    path.write_text(json.dumps(description), encoding="utf-8")
    return path


def without_meshes(urdf, folder):
    """Return a copy of a URDF without visual and collision shapes, which peers insist on."""
    tree = ElementTree.parse(urdf)
    for link in tree.getroot().iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    path = folder / urdf.name
    tree.write(path)
    return path
