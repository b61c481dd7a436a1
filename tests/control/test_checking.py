"""Every exported task, contact and limit against finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc.control
from wbc.control import (
    AngularMomentumTask,
    CapturePointTask,
    CenterOfMassTask,
    CentroidalMomentumTask,
    CollisionLimit,
    Contact,
    FrameDistanceTask,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
    GazeTask,
    JointLimit,
    LinearMomentumTask,
    MotorBraking,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    RotorTorqueLimit,
    Shape,
    SurfaceContact,
    Task,
)
from wbc.control.checking import check_contact, check_joint_limit, check_task, check_torque_limit
from wbc.control.kinematics import Kinematics
from wbc.effects import load_robot

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


def check_of_joint_limit():
    limit = narrow(JointLimit.of(SOLO, acceleration=60.0))
    q, v = SOLO.neutral(), np.zeros(SOLO.model.nv)
    assert check_joint_limit(limit, q, v, duration=0.6) < 1e-12
    fast = v.copy()
    fast[6:] = 2.0
    assert check_joint_limit(limit, q, fast, duration=0.6) < 1e-12


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
            errors = check_torque_limit(robot, limit, q, 0.1 * v, a, contacts=contacts)
            assert errors.gradient < 1e-6
            assert errors.bounds < 1e-8
            assert errors.beyond < 1e-12


def test_limit_checker_sees_a_motor_that_gives_torque_beyond_its_speed_limit():
    class Endless(RotorTorqueLimit):
        def bounds(self, robot, rotor_speed):
            low, high = super().bounds(robot, rotor_speed)
            return np.minimum(low, -1e-3), np.maximum(high, 1e-3)

    q = next(iter(SOLO.poses.values()))
    still = 0.1 * random_motion(SOLO, 3)[1]
    errors = check_torque_limit(
        quick(SOLO), Endless(knee=0.2), q, still, 0.0 * still, contacts=feet(SOLO)
    )
    assert errors.beyond > 1e-3


def test_limit_checker_sees_a_joint_that_brakes_too_late():
    class Late(JointLimit):
        def bounds(self, position, velocity, step):
            low, high = super().bounds(position, velocity, step)
            return low, np.maximum(high, -20.0)

    good = narrow(JointLimit.of(SOLO, acceleration=60.0))
    late = Late(**{name: getattr(good, name) for name in good.__dataclass_fields__})
    q, v = SOLO.neutral(), np.zeros(SOLO.model.nv)
    assert check_joint_limit(late, q, v, duration=0.6) > 1e-3


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
    checked |= {GazeTask, CapturePointTask}  # by the laws of their own in test_more_tasks
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
