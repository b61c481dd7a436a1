"""How the checks move robots: as a command says, without losses, or in the library's plant."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.control import Controller, FramePositionTask
from wbc.robot import Motion
from wbc.sim import Plant

TICK = 1e-3


def followed(robot, controller, pose, ticks, asked, contacts=None, tick=TICK, velocity=None):
    """Yield the command and the state after it, moved by the command's own acceleration."""
    q, v = np.array(pose), np.zeros(robot.model.nv) if velocity is None else np.array(velocity)
    for number in range(ticks):
        references = asked(number) if callable(asked) else asked
        command = controller.step(Motion(q, v), references, contacts, dt=tick)
        if not command.status.usable:
            yield command, Motion(q, v)
            return
        q = pin.integrate(robot.model, q, tick * v + 0.5 * tick**2 * command.acceleration)
        v = v + tick * command.acceleration
        yield command, Motion(q, v)


def ideal(robot, q, v, torque):
    """Return the state after a tick without losses, contacts or limits."""
    model, data = robot.model, robot.model.createData()
    mass = pin.crba(model, data, q)
    gears, driven = robot.transmission, robot.actuated
    turns = gears.motor_from_joint
    mass[np.ix_(driven, driven)] += turns.T * gears.reflected_inertia @ turns
    force = -pin.nonLinearEffects(model, data, q, v)
    force[driven] += turns.T @ (gears.gear_ratio * torque)
    v = v + TICK * np.linalg.solve(mass, force)
    return pin.integrate(model, q, TICK * v), v


def kinetic(robot, q, v):
    """Return the energy of links and rotors [J]; of a free base that beside its fall."""
    data = robot.model.createData()
    gears = robot.transmission
    turning = gears.motor_from_joint @ v[robot.actuated]
    mass = pin.crba(robot.model, data, q)
    energy = 0.5 * (v @ mass @ v + turning @ (gears.reflected_inertia * turning))
    if robot.floating_size:
        pin.centerOfMass(robot.model, data, q, v)
        energy -= 0.5 * pin.computeTotalMass(robot.model) * (data.vcom[0] @ data.vcom[0])
    return energy


def played(robot, controller, pose, ticks, references):
    """Yield the states of a robot in the library's plant."""
    plant = Plant(robot)
    state = plant.state(pose)
    for _ in range(ticks):
        command = controller.step(state, references)
        state = plant.step(state, command.rotor_torque, TICK).state
        yield state


def placement(robot, q, frame):
    """Return where a frame is."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.model.getFrameId(frame)].copy()


def reach(foreign, *more, limits=None, weight=10.0):
    """Return a controller whose hand is free and follows a position; and its contacts."""
    hand = FramePositionTask(name="hand", frame=foreign.hand, weight=weight, stiffness=100.0)
    tasks = [t for t in foreign.tasks() if t.name != "pose"]
    ours = Controller(foreign.robot, [*tasks, hand, *more], foreign.standing, limits)
    names = [c.name for c in foreign.standing if c.name != foreign.free]
    return ours, dict.fromkeys(names, np.inf)


def towards(foreign, length):
    """Return the hand's place and a place `length` away, outwards and up."""
    start = placement(foreign.robot, foreign.pose, foreign.hand).translation
    way = np.array([1.0, 0.0, 1.0]) if foreign.trunk is None else np.array([0.6, 0.3, 1.0])
    return start, start + length * way / np.linalg.norm(way)
