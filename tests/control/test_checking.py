"""Every exported task, contact and limit against finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc.control
from tests.control.scenes import CERTAIN
from wbc.control import (
    AngularMomentumTask,
    CapturePointTask,
    CenterOfMassTask,
    CentroidalMomentumTask,
    CollisionLimit,
    Contact,
    Controller,
    ControllerSettings,
    FrameDistanceTask,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
    JointLimit,
    LinearMomentumTask,
    MotorBraking,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
    RotorTorqueLimit,
    Shape,
    SurfaceContact,
    Task,
    WarmStart,
)
from wbc.control.checking import check_contact, check_task
from wbc.control.kinematics import Kinematics
from wbc.control.qp.problem import INFINITE
from wbc.dynamics import contact_torque, link_torque, rotor_torque
from wbc.effects import load_robot
from wbc.robot import Motion

SOLO = load_robot("solo12")
LEG = load_robot("planar_leg")
TALOS = load_robot("talos")

CASES = {
    "com": (SOLO, CenterOfMassTask()),
    "com_z": (SOLO, CenterOfMassTask(axes="z")),
    "momentum": (SOLO, AngularMomentumTask()),
    "posture": (SOLO, PostureTask.of(SOLO)),
    "position": (SOLO, FramePositionTask(name="foot", frame="FL_FOOT")),
    "position_xz": (SOLO, FramePositionTask(name="foot", frame="FL_FOOT", axes="xz")),
    "orientation": (SOLO, FrameOrientationTask(name="base", frame="base_link")),
    "pose": (SOLO, FramePoseTask(name="base", frame="FL_FOOT")),
    "linear_momentum": (SOLO, LinearMomentumTask(axes="xz")),
    "whole_momentum": (SOLO, CentroidalMomentumTask()),
    "position_in_base": (
        SOLO,
        FramePositionTask(name="foot", frame="FL_FOOT", relative_to="base_link"),
    ),
    "position_in_foot_y": (
        SOLO,
        FramePositionTask(name="foot", frame="FL_FOOT", relative_to="HR_FOOT", axes="y"),
    ),
    "orientation_in_foot": (
        SOLO,
        FrameOrientationTask(name="foot", frame="FL_FOOT", relative_to="HR_FOOT", axes="xz"),
    ),
    "pose_in_base": (SOLO, FramePoseTask(name="foot", frame="FL_FOOT", relative_to="base_link")),
    "distance": (SOLO, FrameDistanceTask(frame="FL_FOOT", other="HR_FOOT")),
    "leg_momentum": (LEG, AngularMomentumTask(axes="y")),
    "leg_posture": (LEG, PostureTask.of(LEG, ("base_pitch", "knee"))),
}


def random_motion(robot, seed):
    rng = np.random.default_rng(seed)
    q = pin.integrate(robot.model, robot.neutral(), rng.uniform(-1, 1, robot.model.nv))
    return q, rng.normal(size=robot.model.nv), rng.normal(size=robot.model.nv)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("seed", range(4))
def test_task_derivatives(case, seed):
    robot, task = CASES[case]
    errors = check_task(robot, task, *random_motion(robot, seed))
    assert errors.jacobian < 1e-6
    assert errors.drift < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_balance_task_accelerates_the_center_of_mass(seed):
    task = PointFootBalanceTask(contact="foot", frame="base")
    assert check_task(LEG, task, *random_motion(LEG, seed)).drift < 1e-6


SOLE = ("left_sole_front_left", "left_sole_front_right")
CONTACTS = {
    "point": (SOLO, PointContact(name="FL_foot")),
    "planar point": (LEG, PointContact(name="foot")),
    "planar slope": (LEG, PointContact(name="foot", ground_normal=(0.2, 0.0, 1.0))),
    "slope": (SOLO, PointContact(name="FL_foot", ground_normal=(0.2, -0.1, 1.0))),
    "sole": (
        TALOS,
        SurfaceContact(name="left", corners=(*SOLE, *(c.replace("front", "rear") for c in SOLE))),
    ),
}


@pytest.mark.parametrize("case", CONTACTS)
def test_contact_drift(case):
    robot, contact = CONTACTS[case]
    assert check_contact(robot, contact, *random_motion(robot, 1)) < 1e-6


def test_pose_in_another_frame_is_what_pinocchio_says():
    """The value of a relative task against placements computed apart."""
    task = FramePoseTask(name="foot", frame="FL_FOOT", relative_to="HR_FOOT")
    q, v, _ = random_motion(SOLO, 5)
    kinematics = Kinematics(SOLO)
    kinematics.update(q, v)
    data = SOLO.model.createData()
    pin.framesForwardKinematics(SOLO.model, data, q)
    own, root = (data.oMf[SOLO.model.getFrameId(n)] for n in ("FL_FOOT", "HR_FOOT"))
    np.testing.assert_allclose(
        task.value(kinematics).homogeneous, (root.inverse() * own).homogeneous, atol=1e-12
    )


def narrow(limit, half=0.3):
    """Return a limit with stops close around zero."""
    return replace(limit, lower=np.full(12, -half), upper=np.full(12, half))


def beyond_stops(limit, position, velocity, step=1e-3):
    """Return how far joints that are driven as hard as their limit allows get beyond its stops."""
    worst = 0.0
    for up in (0, 1):
        q, v = position.copy(), velocity.copy()
        for _ in range(600):
            a = limit.bounds(q, v, step)[up]
            q[limit.position_rows] += step * v[limit.rows] + 0.5 * step**2 * a
            v[limit.rows] += step * a
            at = q[limit.position_rows]
            worst = max(worst, np.maximum(at - limit.upper, limit.lower - at).max())
    return worst


def torque_row_errors(robot, limit, q, v, a, contacts, step=1e-6):
    """Return how far a program's torque rows are from inverse dynamics: gradient, bounds [N m].

    The gradient against central differences of the rotor torques at the solution, as a share of
    the largest, the bounds against what the limit says at these speeds.
    """
    gears, nv = robot.transmission, robot.model.nv
    bound = [contact.bind(robot) for contact in contacts]
    task = PostureTask.of(robot, stiffness=0.0, damping=0.0)
    settings = ControllerSettings(speed_blend=CERTAIN, warm_start=WarmStart.SOLVER)
    controller = Controller(robot, [task], contacts, [limit], settings)
    wanted = Reference(q[robot.actuated_position], None, a[robot.actuated])
    for _ in range(2):  # rows that do not bind stand in the directions of the last tick
        command = controller.step(Motion(q, v), {task.name: wanted})
    weight = -pin.computeTotalMass(robot.model) * robot.model.gravity.linear[2]

    def needed(x):
        forces, at = {}, nv
        for contact in bound:
            own = 0.1 * weight * x[at : at + contact.rows]
            forces[contact.name], at = contact.wrench(own)[None], at + contact.rows
        motion = Motion(q[None], v[None], x[None, :nv])
        pushed = contact_torque(robot, q[None], forces)
        torque, _ = rotor_torque(robot, motion, link_torque(robot, motion), pushed)
        return gears.gear_ratio * torque[0]

    x, problem, m = command.solution.x, controller.problem, gears.size
    two = (problem.C[:m] != problem.C[m : 2 * m]).any(axis=1)  # rows; that for T > 0 stands behind
    own = np.where(two & (command.output_torque > 0.0), m, 0) + np.arange(m)
    rows = problem.C[own]
    found = [needed(x + move) - needed(x - move) for move in step * np.eye(len(x))]
    gradient = np.array(found).T / (2.0 * step) - rows
    speed = gears.gear_ratio * (gears.motor_from_joint @ v[robot.actuated])
    ends = np.sort([gears.gear_ratio * end for end in limit.bounds(robot, speed)], axis=0)
    stated = np.array([problem.lower[own], problem.upper[own]])
    bounds = ends - (needed(x) - rows @ x) - stated
    kept = np.abs(stated) < INFINITE  # on the other side a limit is a union, and no row
    assert kept.any(axis=0).all()
    return np.abs(gradient).max() / np.abs(rows).max(), np.abs(bounds[kept]).max()


def check_of_joint_limit():
    limit = narrow(JointLimit.of(SOLO, acceleration=60.0))
    q, v = SOLO.neutral(), np.zeros(SOLO.model.nv)
    assert beyond_stops(limit, q, v) < 1e-12
    fast = v.copy()
    fast[6:] = 2.0
    assert beyond_stops(limit, q, fast) < 1e-12


def quick(robot):
    """Return the robot with a speed limit that its motors reach in the motions of the checks."""
    m = robot.transmission.size
    return robot.with_transmission(robot.transmission.replace(speed_limit=np.full(m, 15.0)))


def feet(robot, *numbers):
    """Return point contacts, all of a robot's or those of the given numbers."""
    names = [contact.name for contact in robot.contacts]
    return [PointContact(name=names[i]) for i in numbers or range(len(names))]


def check_of_rotor_torque_limit():
    leg, solo = load_robot("planar_leg_strong"), quick(SOLO)
    for robot, contacts in ((leg, feet(leg)), (solo, feet(solo)), (TALOS, feet(TALOS, 0, 4))):
        q = next(iter(robot.poses.values()), robot.neutral())
        _, v, a = random_motion(robot, 3)
        for limit in (RotorTorqueLimit(0.9), RotorTorqueLimit(knee=0.2)):
            gradient, bounds = torque_row_errors(robot, limit, q, 0.1 * v, a, contacts)
            assert gradient < 1e-6
            assert bounds < 1e-8


def check_of_motor_braking():
    """M b = |T| + c with eta_b |T| + N^2 I_r b = share U, from the numbers of the gears."""
    gears = SOLO.transmission
    load, inertia = np.linspace(-0.5, 0.5, 12), np.full(12, 0.01)
    brakes = JointLimit.of(SOLO, braking=MotorBraking(share=0.9)).brakes
    whole = inertia + brakes["reflected"]
    up, down = (brakes["torque"] + load) / whole, (brakes["torque"] - load) / whole
    limit = 0.9 * gears.gear_ratio * gears.torque_limit
    for b, helping in ((up, load), (down, -load)):
        torque = inertia * b - helping
        spent = gears.backward_efficiency * torque + gears.reflected_inertia * b
        np.testing.assert_allclose(spent, limit, rtol=1e-12)


LIMITS = {
    JointLimit: check_of_joint_limit,
    MotorBraking: check_of_motor_braking,
    RotorTorqueLimit: check_of_rotor_torque_limit,
}


@pytest.mark.parametrize("kind", LIMITS, ids=lambda kind: kind.__name__)
def test_limit(kind):
    LIMITS[kind]()


def test_nothing_exported_goes_unchecked():
    exported = {getattr(wbc.control, name) for name in wbc.control.__all__}
    kinds = {kind for kind in exported if isinstance(kind, type)}
    checked = {type(task) for _, task in CASES.values()} | {PointFootBalanceTask}
    checked.add(CapturePointTask)  # by the laws of its own in test_more_tasks
    assert {kind for kind in kinds if issubclass(kind, Task)} - {Task} == checked
    rests = {kind for kind in kinds if issubclass(kind, Contact)} - {Contact}
    assert rests == {type(contact) for _, contact in CONTACTS.values()}
    limits = {k for k in kinds if k.__module__.startswith("wbc.control.rows.limits")}
    assert limits - {CollisionLimit, Shape} == set(LIMITS)  # those in test_collision


def test_checker_sees_a_wrong_drift():
    class Wrong(type(CASES["com"][1])):
        def drift(self, kinematics):
            return super().drift(kinematics) * 1.1

    assert check_task(SOLO, Wrong(), *random_motion(SOLO, 0)).drift > 1e-3
