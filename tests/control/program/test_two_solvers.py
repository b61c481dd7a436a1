"""Every kind of task, contact, limit, effort and level through two solvers and the guess."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

from sims.legged import feet
from tests.control.scenes import moving
from wbc.control import (
    AngularMomentumTask,
    CapturePointTask,
    CenterOfMassTask,
    CentroidalMomentumTask,
    CollisionLimit,
    ContactForceTask,
    Controller,
    ControllerSettings,
    FrameDistanceTask,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
    JointLimit,
    JouleHeatEffort,
    LinearMomentumTask,
    MeshLossEffort,
    MotorBraking,
    OutputTorqueEffort,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
    RotorTorqueEffort,
    RotorTorqueLimit,
    Shape,
    SpeedBlend,
    WarmStart,
)
from wbc.control.qp.solvers import solve
from wbc.effects import load_robot
from wbc.robot import Motion

LEGGED = ("solo12", "anymal", "talos")
TRUNK = {"solo12": "base_link", "anymal": "base", "talos": "torso_2_link"}
CORNER = {"solo12": "FL_foot", "anymal": "LF_foot", "talos": "left_sole_front_left"}
TICKS = 4


def base(robot):
    return [CenterOfMassTask(weight=10.0), PostureTask.of(robot, weight=0.1)]


def frame(robot, kind, **more):
    return kind(name="trunk", frame=TRUNK[robot.name], **more)


def foot(robot):
    return robot.contact(CORNER[robot.name]).frame


def heat(robot):
    m = robot.transmission.size
    given = robot.transmission.replace(resistance=np.full(m, 0.3), torque_constant=np.full(m, 0.1))
    return robot.with_transmission(given)


def apart(robot):
    """Return a limit of the trunk's distance from a ball in the world that is too near."""
    ball = coal.Sphere(0.05)
    trunk = Shape(name="trunk", geometry=ball, frame=TRUNK[robot.name])
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.pose())
    place = data.oMf[robot.model.getFrameId(TRUNK[robot.name])].translation
    post = Shape(
        name="post", geometry=ball, placement=pin.SE3(np.eye(3), place + np.array([0.12, 0.0, 0.0]))
    )
    return [CollisionLimit([trunk, post], [("trunk", "post")], margin=0.025)]


# kind -> what is added to centre of mass and posture on a robot
TASKS = {
    AngularMomentumTask: lambda r: [AngularMomentumTask(weight=0.5)],
    CapturePointTask: lambda r: [CapturePointTask(height=0.3, weight=0.5)],
    CenterOfMassTask: lambda r: [],
    CentroidalMomentumTask: lambda r: [CentroidalMomentumTask(weight=0.1)],
    FrameDistanceTask: lambda r: [FrameDistanceTask(frame=TRUNK[r.name], other=foot(r))],
    FrameOrientationTask: lambda r: [frame(r, FrameOrientationTask)],
    FramePoseTask: lambda r: [frame(r, FramePoseTask, relative_to=foot(r))],
    FramePositionTask: lambda r: [frame(r, FramePositionTask, axes="xz")],
    LinearMomentumTask: lambda r: [LinearMomentumTask(weight=0.1)],
    PostureTask: lambda r: [],
}
EFFORTS = {
    ContactForceTask: lambda r: [
        ContactForceTask(name="load", contact="left" if r.name == "talos" else CORNER[r.name])
    ],
    JouleHeatEffort: lambda r: [JouleHeatEffort(weight=1e-4)],
    MeshLossEffort: lambda r: [MeshLossEffort(weight=1e-3)],
    OutputTorqueEffort: lambda r: [OutputTorqueEffort(weight=1e-4)],
    RotorTorqueEffort: lambda r: [RotorTorqueEffort(weight=1e-2)],
}
LIMITS = {
    CollisionLimit: apart,
    JointLimit: lambda r: [JointLimit.of(r, acceleration=5.0)],
    MotorBraking: lambda r: [JointLimit.of(r, acceleration=20.0, braking=MotorBraking())],
    RotorTorqueLimit: lambda r: [RotorTorqueLimit(fraction=0.5, knee=0.1)],
}
KINDS = [*TASKS, *EFFORTS, *LIMITS]


def moving_slowly(robot, seed):
    return moving(robot, seed, TICKS, 0.005, 0.1)


def agree(robot, tasks, contacts, limits, states, wish):
    """Compare what two solvers and the guess command, tick by tick; return how often it held."""
    certain = SpeedBlend(full_speed=1e-9, correction=0.0, trusted_error=0.0)
    choices = [("proxqp", WarmStart.SOLVER), ("daqp", WarmStart.SOLVER)]
    choices += [("proxqp", WarmStart.ACTIVE_SET), ("daqp", WarmStart.ACTIVE_SET)]
    every = [
        Controller(
            robot,
            tasks,
            contacts,
            limits,
            ControllerSettings(
                speed_blend=certain,
                solver=solver,
                warm_start=start,
                tolerance=1e-9,
                max_iterations=1000,  # solutions are compared here, not what a tick may cost
            ),
        )
        for solver, start in choices
    ]
    usable = 0
    for state in states:
        commands = [controller.step(state, wish) for controller in every]
        one = commands[1]
        told = [f"{c}: {command.message}" for c, command in zip(choices, commands, strict=True)]
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
            assert solution.primal_residual(problem) < 1e-5 * scale
            assert solution.dual_residual(problem) < 1e-5 * scale
            assert solution.duality_gap(problem) < 1e-4 * scale**2
        third = solve("daqp", every[0].problem, tolerance=1e-9, most=1000)
        np.testing.assert_allclose(third.x, one.solution.x, atol=1e-4 * scale)
    return usable


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("name", LEGGED)
def test_two_solvers_and_the_guess_agree(name, kind):
    robot = heat(load_robot(name)) if kind is JouleHeatEffort else load_robot(name)
    more, limits = {**TASKS, **EFFORTS}.get(kind), LIMITS.get(kind)
    tasks = base(robot) + (more(robot) if more else [])
    bounds = limits(robot) if limits else None
    assert agree(robot, tasks, feet(robot), bounds, moving_slowly(robot, 0), {}) == TICKS


@pytest.mark.parametrize("name", LEGGED)
def test_two_solvers_and_the_guess_agree_on_a_lower_level(name):
    """Also where the upper level's optimum lies on as many bounds as there are freedoms."""
    robot = load_robot(name)
    tasks = [CenterOfMassTask(), frame(robot, FrameOrientationTask), PostureTask.of(robot, level=1)]
    states = [state for seed in range(2, 12) for state in moving_slowly(robot, seed)]
    assert agree(robot, tasks, feet(robot), None, states, {}) == len(states)


def test_a_leg_balances_the_same_by_every_way():
    leg = load_robot("planar_leg_strong")
    tasks = [
        CenterOfMassTask(name="height", axes="z", weight=10.0),
        PointFootBalanceTask(contact="foot", frame="base", weight=10.0),
        PostureTask.of(leg, weight=1e-3),
    ]
    q, generator = leg.configuration(hip=-0.35, knee=0.7), np.random.default_rng(1)
    states = [Motion(q, 0.1 * generator.normal(size=5)) for _ in range(6)]
    wish = {"balance": Reference(0.0)}
    assert agree(leg, tasks, [PointContact(name="foot")], None, states, wish) == 6
