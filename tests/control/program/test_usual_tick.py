"""The tick that one call does gives what the parts give one after the other."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.control.scenes import legged
from wbc.control import (
    CenterOfMassTask,
    Controller,
    FrameOrientationTask,
    FramePositionTask,
    PointContact,
    PostureTask,
    Reference,
)
from wbc.control.program.usual_tick import UsualTick
from wbc.robot import Motion

FEET = {"solo12": "FL_foot", "anymal": "LF_foot"}
FIELDS = (
    *("rotor_torque", "acceleration", "output_torque", "mesh_torque"),
    *("expected_speed", "certainty", "position", "velocity"),
)


def stepping(robot):
    """Return a controller with a task for every foot."""
    swings = [
        FramePositionTask(name=f"swing {contact.name}", frame=contact.frame, weight=5.0)
        for contact in robot.contacts
    ]
    base = robot.model.frames[2].name
    trunk = FrameOrientationTask(name="trunk", frame=base)
    tasks = [CenterOfMassTask(weight=10.0), trunk, PostureTask.of(robot, weight=0.1), *swings]
    return Controller(robot, tasks, [PointContact(name=contact.name) for contact in robot.contacts])


def by_parts(controller):
    """Return the controller without its usual tick."""
    for levels in controller._programs._made.values():
        for level in levels:
            level.usual = None
    return controller


def ticks(robot, count):
    """Return arguments of `step`: references, contacts, activations and time steps come and go."""
    generator, nv = np.random.default_rng(3), robot.model.nv
    q, names = next(iter(robot.poses.values())), [contact.name for contact in robot.contacts]
    off, height = {f"swing {name}": 0.0 for name in names}, 0.0
    for tick in range(count):
        near = pin.integrate(robot.model, q, 3e-3 * generator.normal(size=nv))
        speed = 0.5 if tick % 40 == 39 else 5e-3
        state = Motion(near, speed * generator.normal(size=nv))
        phase, references, contacts, more = tick // 10 % 6, {}, None, {"activation": off}
        if tick % 3:
            height = 1e-3 * generator.normal()
            com = np.array(pin.centerOfMass(robot.model, robot.model.createData(), q))
            velocity = None if tick % 2 else np.array([0.0, 0.0, height])
            references = {"center_of_mass": Reference(com + np.array([0.0, 0.0, height]), velocity)}
        if phase == 1:
            contacts = {name: 40.0 if name == names[0] else np.inf for name in names}
        elif phase == 2:
            contacts = dict.fromkeys(names[1:], np.inf)
            more = {"activation": off | {f"swing {names[0]}": 1.0}}
        elif phase == 3:
            contacts, more = {}, {"dt": 2e-3}
        elif phase == 4:
            more = {"activation": off, "weights": {"posture": 0.3}}
        if tick % 50 == 49:
            references = {"center_of_mass": Reference(np.full(3, np.nan))}
        yield (state, references, contacts), more


@pytest.mark.parametrize("name", ["solo12", "anymal"])
def test_one_call_does_what_the_parts_do(name):
    """With changing references, contacts, weights, time steps, limits and refused ticks."""
    robot = legged(name)
    ours, parts = stepping(robot), by_parts(stepping(robot))
    statuses = set()
    for tick, (arguments, more) in enumerate(ticks(robot, 240)):
        if tick == 120:
            ours.reset()
            parts.reset()
        found, expected = ours.step(*arguments, **more), parts.step(*arguments, **more)
        statuses.add(found.status)
        assert found.status is expected.status
        assert (found.rounds, found.iterations) == (expected.rounds, expected.iterations)
        for field in FIELDS:
            np.testing.assert_allclose(
                getattr(found, field), getattr(expected, field), rtol=1e-12, atol=1e-12
            )
        assert found.forces.keys() == expected.forces.keys()
        for contact, force in found.forces.items():
            np.testing.assert_allclose(force, expected.forces[contact], rtol=1e-12, atol=1e-12)
        if found.status.usable:
            for one, other in zip(found.solution[:3], expected.solution[:3], strict=True):
                np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
            for one, other in zip(ours.problem, parts.problem, strict=True):
                np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
    assert len(statuses) > 1


def test_standing_swinging_and_flying_are_usual(monkeypatch):
    """Else a tick costs twice as much: only the first one, which takes its targets, is not."""
    robot, seen, run = legged("solo12"), [], UsualTick.run
    monkeypatch.setattr(
        UsualTick, "run", lambda *given, **more: seen.append(1) or run(*given, **more)
    )
    names = [contact.name for contact in robot.contacts]
    state = Motion(next(iter(robot.poses.values())), np.zeros(robot.model.nv))
    off = {f"swing {name}": 0.0 for name in names}
    for more in (
        {"activation": off},
        {"activation": off | {f"swing {names[0]}": 1.0}, "contacts": dict.fromkeys(names[1:], 1e9)},
        {"contacts": {}},
    ):
        ours = stepping(robot)
        seen.clear()
        for _ in range(10):
            assert ours.step(state, **more).status.usable
        assert len(seen) == 9


def test_a_command_keeps_what_it_says():
    """The next tick overwrites nothing of it."""
    robot = legged("solo12")
    ours = stepping(robot)
    state = Motion(next(iter(robot.poses.values())), np.zeros(robot.model.nv))
    commands = [ours.step(state) for _ in range(3)]
    kept = [getattr(commands[1], field).copy() for field in FIELDS]
    ours.step(Motion(state.position, 0.1 * np.ones(robot.model.nv)))
    for field, value in zip(FIELDS, kept, strict=True):
        np.testing.assert_array_equal(getattr(commands[1], field), value)
