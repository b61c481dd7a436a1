"""`step` never raises, is always bounded and always safe: hostile states and inputs."""

from __future__ import annotations

import gc
from itertools import islice

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.controller_hostile import budget, hostile_inputs, kept, quiet
from benchmarks.controller_scenes import controller
from wbc.control import (
    Controller,
    ControllerSettings,
    JointLimit,
    PostureTask,
    RotorTorqueEffort,
    RotorTorqueLimit,
    Status,
    explain,
)
from wbc.control.qp.problem import QPStatus
from wbc.control.qp.solvers import solve
from wbc.effects import load_robot
from wbc.robot import Motion
from wbc.robot.library import robot_names

ROUNDS = ControllerSettings().max_rounds


@pytest.mark.parametrize(
    ("name", "ticks"),
    [("planar_leg_strong", 1500), ("solo12", 1200), ("anymal", 600), ("talos", 500)],
)
def test_hostile_ticks_are_bounded_and_safe(name, ticks):
    robot, generator = load_robot(name), np.random.default_rng(1)
    ours = controller(robot)
    cases = hostile_inputs(robot, ours, generator)
    for tick in range(ticks):
        arguments = next(cases)
        command = ours.step(*arguments)
        assert kept(robot, command, budget(ours)), (tick, command.message)
        assert command.rounds <= ROUNDS
        assert command.iterations <= budget(ours)
        if not command.status.usable:
            assert command.message
    ours.reset()  # wild targets are held, as any target is
    assert ours.step(quiet(robot, generator)).status is Status.SOLVED


@pytest.mark.parametrize("name", ["solo12", "talos"])
def test_a_motion_is_found_where_there_is_one(name):
    """Whatever the solvers may cost, and however many directions may be searched."""
    robot, generator = load_robot(name), np.random.default_rng(0)
    ours = controller(robot)
    patient = controller(robot, max_iterations=10000, max_rounds=100)
    ticks = possible = missed = 0
    for arguments in islice(hostile_inputs(robot, ours, generator), 120):
        command, ticks = ours.step(*arguments), ticks + 1
        if patient.step(*arguments).status.usable:
            possible += 1
            missed += not command.status.usable
    assert possible > 0.3 * ticks
    assert missed < 0.01 * possible


def test_a_tick_leaves_nothing_for_the_garbage_collector():
    """A full collection takes 64 ms in a process of usual size: a loop may turn it off."""
    robot, generator = load_robot("solo12"), np.random.default_rng(0)
    ours = controller(robot)
    cases = list(islice(hostile_inputs(robot, ours, generator), 200))
    gc.collect()
    gc.disable()
    try:
        for arguments in cases:
            ours.step(*arguments)
        assert gc.collect() == 0
    finally:
        gc.enable()


@pytest.mark.parametrize("name", robot_names())
def test_every_shipped_robot_keeps_the_promise(name):
    """With efforts, joint limits and a second level, and without contacts."""
    robot, generator = load_robot(name), np.random.default_rng(2)
    driven = robot.transmission.joints
    tasks = [
        PostureTask.of(robot, driven[:1], name="first"),
        PostureTask.of(robot, name="rest", level=1),
        RotorTorqueEffort(weight=1e-3),
    ]
    limits = [RotorTorqueLimit(), JointLimit.of(robot)]
    ours = Controller(robot, tasks, limits=limits)
    for _ in range(40):
        speed = generator.choice([0.1, 3.0, 100.0, 1e9])
        q = pin.integrate(robot.model, robot.neutral(), generator.normal(size=robot.model.nv))
        command = ours.step(Motion(q, speed * generator.normal(size=robot.model.nv)))
        assert np.isfinite(command.rotor_torque).all()
        assert kept(robot, command, budget(ours))
        assert command.rounds <= 2 * ROUNDS
        assert command.iterations <= budget(ours)


def test_a_conflict_is_explained_when_somebody_asks():
    robot, generator = load_robot("solo12"), np.random.default_rng(0)
    ours, told = controller(robot), []
    q = robot.pose()
    for _ in range(10):
        v = np.zeros(robot.model.nv)
        v[robot.actuated] = 50.0 * generator.normal(size=12)
        command = ours.step(Motion(q, v))
        assert command.status is Status.INFEASIBLE
        told.append(command)
    for command in told:  # each by its own program, although ticks have passed
        assert "cannot be kept" in explain(command)
        assert "missing" in explain(command)
    assert explain(ours.step(Motion(q, np.zeros(robot.model.nv)))) == ""
    assert "position" in explain(ours.step(None))


@pytest.mark.parametrize("name", ["planar_leg_strong", "solo12", "talos"])
def test_what_is_called_a_contradiction_is_one(name):
    """Another solver finds no motion either for the program of a tick that was refused."""
    robot, generator = load_robot(name), np.random.default_rng(3)
    ours, refused = controller(robot), []
    cases = hostile_inputs(robot, ours, generator)
    while len(refused) < 25:
        command = ours.step(*next(cases))
        if command.status is Status.INFEASIBLE and "cannot be kept" in command.message:
            refused.append(command.refused.problem.dense())
    found = [solve("daqp", problem, tolerance=1e-6, most=10000) for problem in refused]
    assert sum(one.status is QPStatus.SOLVED for one in found) == 0
