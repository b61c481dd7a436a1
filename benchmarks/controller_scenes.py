"""Robots, tasks, contacts and motions on which controllers are timed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from sims.leg import balanced_pose
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    FrameOrientationTask,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
    SurfaceContact,
)
from wbc.dynamics import evaluate
from wbc.effects import EFFECTS, load_robot
from wbc.robot import Motion

COM_WEIGHT, TRUNK_WEIGHT, POSTURE_WEIGHT, STIFFNESS = 10.0, 1.0, 0.1, 50.0
FRICTION = 0.1  # [N m]
AIRBORNE, RAMP = 0.35, 0.3  # [rad] of the phase, half of the time without load, and its ramp
REACH = {"talos": [0.0, 0.07, 0.0], "solo12": [0.02, 0.02, 0.0], "anymal": [0.04, 0.04, 0.0]}
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
        contacts: greatest normal force of every contact that may carry any, None for all.
    """

    motion: Motion
    references: dict
    com: np.ndarray
    contacts: dict | None


def standing(robot):
    """Return the pose that the robot's description names, or a bent leg."""
    if robot.poses:
        return np.array(next(iter(robot.poses.values())))
    return balanced_pose(robot)


def controller(robot, **settings):
    """Return the timed controller: centre of mass, trunk, posture; every contact of the robot.

    On one point foot, where no torque holds the trunk, balancing stands for both.
    """
    posture = PostureTask.of(robot, weight=POSTURE_WEIGHT, stiffness=STIFFNESS)
    if robot.has_free_flyer:
        trunk = FrameOrientationTask(
            name="trunk", frame=TRUNK[robot.name], weight=TRUNK_WEIGHT, stiffness=STIFFNESS
        )
        tasks = [
            CenterOfMassTask(weight=COM_WEIGHT, stiffness=STIFFNESS, acceleration_limit=np.inf),
            trunk,
            posture,
        ]
    else:
        height = CenterOfMassTask(
            weight=COM_WEIGHT, stiffness=STIFFNESS, axes="z", acceleration_limit=np.inf
        )
        balance = PointFootBalanceTask(contact="foot", frame=TRUNK[robot.name], weight=COM_WEIGHT)
        tasks = [height, balance, PostureTask.of(robot, weight=1e-3)]
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


def stance(robot, phase):
    """Return the greatest normal force by contact [N] at a phase of the motion; all when planar.

    A foot whose side the centre of mass has left gives its load off, stands aside, and takes it up
    again, each by a ramp.
    """
    weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
    if not robot.has_free_flyer:
        return None
    if robot.name == "talos":
        leaving = {"left": 1.5 * np.pi, "right": 0.5 * np.pi}
    else:
        leaving = {}
        for contact in robot.contacts:
            corner = contact.name.split("_")[0]
            fore, left = ("F" in corner) - 0.5, ("L" in corner) - 0.5
            leaving[contact.name] = np.arctan2(-left, -fore)
    limits = {}
    for name, where in leaving.items():
        away = abs((phase - where + np.pi) % (2.0 * np.pi) - np.pi)
        load = np.clip((away - AIRBORNE) / RAMP, 0.0, 1.0)
        if load > 0.0:
            limits[name] = float(np.inf if load == 1.0 else load * weight)
    return limits


def motion(robot, ticks, *, step=1e-3, rate=0.25, flies=False):
    """Return the states of a squat while the weight goes round, as the controller itself moves.

    The gears are ideal. On four feet or two, one foot after the other is lifted from its load. One
    that flies falls freely and has no contacts.
    """
    q = standing(robot)
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    start = np.array(terms.data.com[0])
    rows = slice(None) if robot.has_free_flyer else slice(2, 3)
    drive = controller(robot)
    v, states = np.zeros(robot.model.nv), []
    depth, turn = 0.02 * start[2], 2.0 * np.pi * rate
    reach = np.array(REACH.get(robot.name, [0.0, 0.0, 0.0]))
    for tick in range(ticks):
        phase = turn * tick * step
        eased = min(1.0, tick / 500)  # from rest
        turning = np.array(
            [
                [np.cos(phase), np.sin(phase), np.cos(2.0 * phase) - 1.0],
                [-np.sin(phase), np.cos(phase), -2.0 * np.sin(2.0 * phase)],
                [-np.cos(phase), -np.sin(phase), -4.0 * np.cos(2.0 * phase)],
            ]
        )
        size = eased * (reach + np.array([0.0, 0.0, depth]))
        com = turning * size * np.array([[1.0], [turn], [turn**2]])
        com[0] += start
        if flies:
            time = tick * step
            fall = np.array([0.0, 0.0, -9.81])
            com = np.array([start + 0.5 * time**2 * fall, time * fall, fall])
        references = {"center_of_mass": Reference(com[0, rows], com[1, rows], com[2, rows])}
        contacts = {} if flies else None if tick < 500 else stance(robot, phase)
        states.append(Tick(Motion(q.copy(), v.copy()), references, com, contacts))
        command = drive.step(states[-1].motion, references, contacts)
        if not command.status.usable:
            raise RuntimeError(f"{robot.name}: tick {tick}: {command.message}")
        v = v + step * command.acceleration
        q = pin.integrate(robot.model, q, step * v)
    return states


def scene(name, ticks, *, flies=False):
    """Return a robot by name, with Coulomb friction at every joint, and its motion."""
    robot = load_robot(name)
    kind, states = EFFECTS["coulomb_friction"], motion(robot.lossless(), ticks, flies=flies)
    value = {kind.parameters[0].name: FRICTION}
    joints = robot.transmission.joints
    return robot.with_effects(*[kind.at(joint, value) for joint in joints]), states
