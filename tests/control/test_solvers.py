"""Every kind of task, contact, limit, effort and level through two solvers and the guess."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

from sims.legged import feet
from tests.control.scenes import CERTAIN, TRUNK, moving, place_of, trunk, usual
from tests.sim.random_robots import geared
from wbc import control, load_robot
from wbc.control import Controller, ControllerSettings, Status, WarmStart
from wbc.control.qp import level
from wbc.control.qp.level import LevelAnswer
from wbc.control.qp.solvers import solve
from wbc.robot import Motion

ROBOTS = ["solo12", "talos"]
WAYS = [(solver, start) for start in WarmStart for solver in ("proxqp", "daqp")]
TICKS = 4
MANY = 1000  # solutions are compared here, not what a tick may cost


def apart(robot):
    """Return a limit of the trunk's distance from a ball in the world that is too near."""
    ball, place = coal.Sphere(0.05), place_of(robot, robot.pose(), TRUNK[robot.name])
    beside = pin.SE3(np.eye(3), place + np.array([0.12, 0.0, 0.0]))
    shapes = [
        control.Shape(name="trunk", geometry=ball, frame=TRUNK[robot.name]),
        control.Shape(name="post", geometry=ball, placement=beside),
    ]
    return control.CollisionLimit(shapes, [("trunk", "post")], margin=0.025)


# What is added to centre of mass and posture on a robot.
TASKS = {
    "angular momentum": lambda r: control.AngularMomentumTask(weight=0.5),
    "capture point": lambda r: control.CapturePointTask(height=0.3, weight=0.5),
    "momentum": lambda r: control.CentroidalMomentumTask(weight=0.1),
    "distance": lambda r: control.FrameDistanceTask(frame=TRUNK[r.name], other=r.contacts[0].frame),
    "orientation": trunk,
    "pose": lambda r: trunk(r, control.FramePoseTask),
    "position": lambda r: trunk(r, control.FramePositionTask, axes="xz"),
    "linear momentum": lambda r: control.LinearMomentumTask(weight=0.1),
    "heat": lambda r: control.JouleHeatEffort(weight=1e-4),
    "loss": lambda r: control.MeshLossEffort(weight=1e-3),
    "output torque": lambda r: control.OutputTorqueEffort(weight=1e-4),
    "rotor torque": lambda r: control.RotorTorqueEffort(weight=1e-2),
}
LIMITS = {
    "collision": apart,
    "joints": lambda r: control.JointLimit.of(r, acceleration=5.0),
    "braking": lambda r: control.JointLimit.of(r, acceleration=20.0, braking=0.8),
    "torque": lambda r: control.RotorTorqueLimit(fraction=0.5, knee=0.1),
}


def moving_slowly(robot, seed):
    return moving(robot, seed, TICKS, 0.005, 0.1)


def agree(robot, tasks, contacts, limits, states, wish):
    """Compare what two solvers and the guess command, tick by tick; return how often it held."""
    exact = ControllerSettings(speed_blend=CERTAIN, tolerance=1e-9, max_iterations=MANY)
    every = [
        Controller(robot, tasks, contacts, limits, replace(exact, solver=solver, warm_start=start))
        for solver, start in WAYS
    ]
    usable = 0
    for state in states:
        commands = [controller.step(state, wish) for controller in every]
        one = commands[1]
        told = [f"{way}: {command.message}" for way, command in zip(WAYS, commands, strict=True)]
        assert {command.status for command in commands} == {one.status}, told
        if not one.status.usable:
            continue
        usable += 1
        scale = 1.0 + np.abs(one.acceleration).max()
        weight = 1.0 + sum(np.abs(force).max() for force in one.forces.values())
        for controller, command in zip(every, commands, strict=True):
            near = {"atol": 1e-4 * scale, "rtol": 0.0}
            np.testing.assert_allclose(command.acceleration, one.acceleration, **near)
            torque = 1e-4 * (1.0 + np.abs(one.rotor_torque).max())
            np.testing.assert_allclose(command.rotor_torque, one.rotor_torque, atol=torque)
            for name, force in one.forces.items():
                np.testing.assert_allclose(command.forces[name], force, atol=1e-3 * weight)
            problem, solution = controller.problem, command.solution
            broken, gradient, gap = solution.residuals(problem)
            assert max(broken, gradient) < 1e-5 * scale
            assert gap < 1e-4 * scale**2
        third = solve("daqp", every[0].problem, tolerance=1e-9, most=1000)
        np.testing.assert_allclose(third.x, one.solution.x, atol=1e-4 * scale)
    return usable


@pytest.mark.parametrize("kind", [*TASKS, *LIMITS])
@pytest.mark.parametrize("name", ROBOTS)
def test_two_solvers_and_the_guess_agree(name, kind):
    robot = geared(load_robot(name), resistance=0.3, torque_constant=0.1)
    tasks = usual(robot, *([TASKS[kind](robot)] if kind in TASKS else []))
    limits = [LIMITS[kind](robot)] if kind in LIMITS else None
    assert agree(robot, tasks, feet(robot), limits, moving_slowly(robot, 0), {}) == TICKS


@pytest.mark.parametrize("name", ROBOTS)
def test_two_solvers_and_the_guess_agree_on_a_lower_level(name):
    """Also where the upper level's optimum lies on as many bounds as there are freedoms."""
    robot = load_robot(name)
    lower = control.PostureTask.of(robot, level=1)
    states = [state for seed in range(2, 12) for state in moving_slowly(robot, seed)]
    tasks = [control.CenterOfMassTask(), trunk(robot), lower]
    assert agree(robot, tasks, feet(robot), None, states, {}) == len(states)


def test_daqp_behind_a_solver_that_gives_up_is_exact(monkeypatch):
    robot = load_robot("solo12")
    asked = ControllerSettings(solver="proxqp", warm_start=WarmStart.SOLVER)
    made = [Controller(robot, usual(robot), feet(robot), settings=asked) for _ in range(2)]
    state = next(moving_slowly(robot, 0))
    right = made[0].step(state)
    monkeypatch.setattr(level, "solve", lambda *a, **k: level.NOTHING)
    left = made[1].step(state)
    assert left.status is Status.SOLVED
    np.testing.assert_allclose(left.rotor_torque, right.rotor_torque, atol=1e-6)


def test_a_leg_balances_the_same_by_every_way():
    leg = load_robot("planar_leg_strong")
    tasks = [
        control.CenterOfMassTask(name="height", axes="z", weight=10.0),
        control.PointFootBalanceTask(contact="foot", frame="base", weight=10.0),
        control.PostureTask.of(leg, weight=1e-3),
    ]
    q, generator = leg.configuration(hip=-0.35, knee=0.7), np.random.default_rng(1)
    states = [Motion(q, 0.1 * generator.normal(size=5)) for _ in range(6)]
    wish = {"balance": control.Reference(0.0)}
    assert agree(leg, tasks, feet(leg), None, states, wish) == 6


def overdetermined(robot, **settings):
    """Return a controller of centre of mass and all joints, and one with a task beneath them."""
    upper = [control.CenterOfMassTask(), control.PostureTask.of(robot)]
    chosen, lower = ControllerSettings(**settings), [*upper, trunk(robot, level=1)]
    return (Controller(robot, tasks, feet(robot), settings=chosen) for tasks in (upper, lower))


@pytest.mark.parametrize(("solver", "start"), [WAYS[0], WAYS[-1]])
@pytest.mark.parametrize("few", [False, True], ids=["all_feet", "half_the_feet"])
@pytest.mark.parametrize("name", ROBOTS)
def test_every_tick_under_an_overdetermined_level_is_solved(name, few, solver, start):
    """Centre of mass and every joint are decided: level 1 is solved and changes neither.

    States are fast enough that friction cones bind in many of them.
    """
    robot, ticks = load_robot(name), 120
    # 6 of 200 on Talos need 148 to 221 units
    alone, both = overdetermined(robot, solver=solver, warm_start=start, max_iterations=MANY)
    on = [contact.name for contact in feet(robot)]
    contacts = dict.fromkeys(on[: len(on) // 2] if few else on, np.inf)
    bound = 0
    for state in moving(robot, 0, ticks, 0.02, 0.3):
        one, two = (c.step(state, contacts=contacts) for c in (alone, both))
        assert one.status is Status.SOLVED
        assert two.status is Status.SOLVED, two.message
        bound += bool((np.abs(one.solution.z) > 1e-5).any())
        scale = 1.0 + np.abs(one.acceleration).max()
        np.testing.assert_allclose(two.acceleration, one.acceleration, atol=1e-6 * scale)
    assert bound > ticks // 10


def test_a_lower_level_without_a_solution_leaves_the_upper_one_in_force(monkeypatch):
    robot = load_robot("solo12")
    alone, both = overdetermined(robot)
    second, solve = both._levels.of(None, 1e-3)[0][1], Controller._solve
    found = second.unsearched._replace(verdict=(Status.FAILED, "the solver gave up."))
    gave_up = LevelAnswer(second, np.zeros(0), 1e-3, found, 0.0, 0)
    monkeypatch.setattr(
        Controller, "_solve", lambda t, at, *a: gave_up if at is second else solve(t, at, *a)
    )
    state = next(moving(robot, 1, 1, 0.02, 0.3))
    one, two = alone.step(state), both.step(state)
    assert two.status is Status.INACCURATE
    assert two.message == "the tasks of a lower level are left out: the solver gave up."
    np.testing.assert_array_equal(two.rotor_torque, one.rotor_torque)
    assert two.solution.residuals(both.problem)[0] < 1e-5
