"""Every exported task and contact against finite differences."""

import numpy as np
import pinocchio as pin
import pytest

import wbc.control
from wbc import control, load_robot
from wbc.control.checking import check_contact, check_task

SOLO = load_robot("solo12")
LEG = load_robot("planar_leg")
TALOS = load_robot("talos")

CASES = {
    "com": (SOLO, control.CenterOfMassTask()),
    "com_z": (SOLO, control.CenterOfMassTask(axes="z")),
    "momentum": (SOLO, control.AngularMomentumTask()),
    "posture": (SOLO, control.PostureTask.of(SOLO)),
    "position": (SOLO, control.FramePositionTask(name="foot", frame="FL_FOOT")),
    "position_xz": (SOLO, control.FramePositionTask(name="foot", frame="FL_FOOT", axes="xz")),
    "orientation": (SOLO, control.FrameOrientationTask(name="base", frame="base_link")),
    "pose": (SOLO, control.FramePoseTask(name="base", frame="FL_FOOT")),
    "linear_momentum": (SOLO, control.LinearMomentumTask(axes="xz")),
    "whole_momentum": (SOLO, control.CentroidalMomentumTask()),
    "distance": (SOLO, control.FrameDistanceTask(frame="FL_FOOT", other="HR_FOOT")),
    "leg_momentum": (LEG, control.AngularMomentumTask(axes="y")),
    "leg_posture": (LEG, control.PostureTask.of(LEG, ("base_pitch", "knee"))),
}


def random_motion(robot, seed):
    rng = np.random.default_rng(seed)
    q = pin.integrate(robot.model, robot.neutral(), rng.uniform(-1, 1, robot.model.nv))
    return q, rng.normal(size=robot.model.nv), rng.normal(size=robot.model.nv)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("seed", range(2))
def test_task_derivatives(case, seed):
    robot, task = CASES[case]
    errors = check_task(robot, task, *random_motion(robot, seed))
    assert errors.jacobian < 1e-6
    assert errors.drift < 1e-6


def test_balance_task_accelerates_the_center_of_mass():
    task = control.PointFootBalanceTask(contact="foot", frame="base")
    assert check_task(LEG, task, *random_motion(LEG, 0)).drift < 1e-6


SOLE = ("left_sole_front_left", "left_sole_front_right")
CONTACTS = {
    "point": (SOLO, control.PointContact(name="FL_foot")),
    "planar point": (LEG, control.PointContact(name="foot")),
    "planar slope": (LEG, control.PointContact(name="foot", ground_normal=(0.2, 0.0, 1.0))),
    "slope": (SOLO, control.PointContact(name="FL_foot", ground_normal=(0.2, -0.1, 1.0))),
    "sole": (
        TALOS,
        control.SurfaceContact(
            name="left", corners=(*SOLE, *(c.replace("front", "rear") for c in SOLE))
        ),
    ),
}


@pytest.mark.parametrize("case", CONTACTS)
def test_contact_drift(case):
    robot, contact = CONTACTS[case]
    assert check_contact(robot, contact, *random_motion(robot, 1)) < 1e-6


def test_nothing_exported_goes_unchecked():
    kinds = {kind for kind in vars(wbc.control).values() if isinstance(kind, type)}
    checked = {type(task) for _, task in CASES.values()} | {control.PointFootBalanceTask}
    checked.add(control.CapturePointTask)  # by the law of its own in test_tasks
    assert {kind for kind in kinds if issubclass(kind, control.Task)} - {control.Task} == checked
    rests = {kind for kind in kinds if issubclass(kind, control.Contact)} - {control.Contact}
    assert rests == {type(contact) for _, contact in CONTACTS.values()}


def test_checker_sees_a_wrong_drift():
    class Wrong(type(CASES["com"][1])):
        def drift(self, kinematics):
            return super().drift(kinematics) * 1.1

    assert check_task(SOLO, Wrong(), *random_motion(SOLO, 0)).drift > 1e-3
