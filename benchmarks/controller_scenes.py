"""Robots, tasks, contacts and motions on which controllers are timed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    FrameOrientationTask,
    PointContact,
    PostureTask,
    Reference,
    SurfaceContact,
)
from wbc.dynamics import evaluate
from wbc.effects import load_robot
from wbc.robot import Motion

COM_WEIGHT, TRUNK_WEIGHT, POSTURE_WEIGHT, STIFFNESS = 10.0, 1.0, 0.1, 50.0
TRUNK = {
    "talos": "torso_2_link",
    "solo12": "base_link",
    "anymal": "base",
    "planar_leg_strong": "base",
}
URDF = {
    "talos": "talos_data/robots/talos_reduced.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
}


@dataclass(frozen=True, eq=False)
class Tick:
    """One state along a motion with its references.

    Attributes:
        motion: q and v.
        references: of the controller's tasks.
        com: target position, velocity and acceleration of the centre of mass (3, 3).
    """

    motion: Motion
    references: dict
    com: np.ndarray


def standing(robot):
    """Return the pose that the robot's description names, or a bent leg."""
    if robot.poses:
        return np.array(next(iter(robot.poses.values())))
    return robot.configuration(hip=-0.3715, knee=0.7, base_z=0.7513)


def controller(robot, **settings):
    """Return the timed controller: centre of mass, trunk, posture; every contact of the robot."""
    trunk = TRUNK[robot.name]
    posture = PostureTask.of(robot, weight=POSTURE_WEIGHT, stiffness=STIFFNESS)
    planar = not robot.has_free_flyer
    tasks = [
        CenterOfMassTask(weight=COM_WEIGHT, stiffness=STIFFNESS, axes="xz" if planar else "xyz"),
        FrameOrientationTask(
            name="trunk",
            frame=trunk,
            weight=TRUNK_WEIGHT,
            stiffness=STIFFNESS,
            axes="y" if planar else "xyz",
        ),
        posture,
    ]
    if robot.name == "talos":
        contacts = [
            SurfaceContact(
                name=side,
                corners=tuple(
                    f"{side}_sole_{a}_{b}" for a in ("front", "rear") for b in ("left", "right")
                ),
            )
            for side in ("left", "right")
        ]
    else:
        contacts = [PointContact(name=contact.name) for contact in robot.contacts]
    return Controller(robot, tasks, contacts, settings=ControllerSettings(**settings))


def motion(robot, ticks, *, step=1e-3, rate=1.0):
    """Return the states of a squat with sway that the controller itself produces, gears ideal."""
    q = standing(robot)
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    start = np.array(terms.data.com[0])
    rows = slice(None) if robot.has_free_flyer else slice(0, 3, 2)
    drive = controller(robot)
    v, states = np.zeros(robot.model.nv), []
    depth, turn = 0.02 * start[2], 2.0 * np.pi * rate
    sway = np.array([0.0, 0.3 * depth if robot.has_free_flyer else 0.0, 0.0])
    for tick in range(ticks):
        phase = turn * tick * step
        down = np.array([0.0, 0.0, depth])
        com = np.array(
            [
                start + sway * np.sin(phase) + down * (np.cos(phase) - 1.0),
                turn * (sway * np.cos(phase) - down * np.sin(phase)),
                -(turn**2) * (sway * np.sin(phase) + down * np.cos(phase)),
            ]
        )
        references = {"center_of_mass": Reference(com[0, rows], com[1, rows], com[2, rows])}
        states.append(Tick(Motion(q.copy(), v.copy()), references, com))
        command = drive.step(states[-1].motion, references)
        if not command.status.usable:
            raise RuntimeError(f"{robot.name}: tick {tick}: {command.message}")
        v = v + step * command.acceleration
        q = pin.integrate(robot.model, q, step * v)
    return states


def scene(name, ticks, *, lossless=False):
    """Return a robot by name and its motion."""
    robot = load_robot(name)
    return (robot.lossless() if lossless else robot), motion(load_robot(name), ticks)
