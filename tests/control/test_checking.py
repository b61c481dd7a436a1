"""Every task's Jacobian and drift against finite differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.control import (
    AngularMomentumTask,
    CenterOfMassTask,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
)
from wbc.control.checking import check_contact, check_task
from wbc.effects import load_robot

SOLO = load_robot("solo12")
LEG = load_robot("planar_leg")

CASES = {
    "com": (SOLO, CenterOfMassTask()),
    "com_z": (SOLO, CenterOfMassTask(axes="z")),
    "momentum": (SOLO, AngularMomentumTask()),
    "posture": (SOLO, PostureTask.of(SOLO)),
    "position": (SOLO, FramePositionTask(name="foot", frame="FL_FOOT")),
    "position_xz": (SOLO, FramePositionTask(name="foot", frame="FL_FOOT", axes="xz")),
    "orientation": (SOLO, FrameOrientationTask(name="base", frame="base_link")),
    "pose": (SOLO, FramePoseTask(name="base", frame="FL_FOOT")),
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
def test_balance_task_accelerates_the_centre_of_mass(seed):
    task = PointFootBalanceTask(contact="foot", frame="base")
    assert check_task(LEG, task, *random_motion(LEG, seed)).drift < 1e-6


@pytest.mark.parametrize(("robot", "name"), [(SOLO, "FL_foot"), (LEG, "foot")])
def test_contact_drift(robot, name):
    assert check_contact(robot, PointContact(name=name), *random_motion(robot, 1)) < 1e-6


def test_checker_sees_a_wrong_drift():
    class Wrong(type(CASES["com"][1])):
        def drift(self, kinematics):
            return super().drift(kinematics) * 1.1

    assert check_task(SOLO, Wrong(), *random_motion(SOLO, 0)).drift > 1e-3
