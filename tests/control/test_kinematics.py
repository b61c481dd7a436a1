"""Joints whose axes move in their bodies, and turns of any size, against pinocchio."""

import numpy as np
import pinocchio as pin

from wbc.arrays import frozen
from wbc.control import CenterOfMassTask, CentroidalMomentumTask, FramePoseTask
from wbc.control.checking import check_task
from wbc.control.kinematics import Kinematics, place_turn
from wbc.robot import Robot
from wbc.transmission import Transmission


def test_joints_whose_axes_move_in_their_bodies():
    """A ball joint by three angles: there drifts and bias come from pinocchio."""
    model = pin.Model()
    for kind, name in ((pin.JointModelSphericalZYX(), "ball"), (pin.JointModelRY(), "hinge")):
        joint = model.addJoint(model.njoints - 1, kind, pin.SE3.Random(), name)
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("lower", joint, 0, pin.SE3.Random(), pin.FrameType.BODY))
    gears = Transmission(joints=("hinge",), gear_ratio=[10.0], rotor_inertia=[1e-4])
    robot, generator = Robot("ball", model, gears), np.random.default_rng(1)
    q, v, a = generator.uniform(-1.0, 1.0, 4), *generator.normal(size=(2, 4))
    pose = FramePoseTask(name="lower", frame="lower")
    for task in (pose, CenterOfMassTask(), CentroidalMomentumTask()):
        errors = check_task(robot, task, q, v, a)
        assert max(errors.jacobian, errors.drift) < 1e-6
    kinematics = Kinematics(robot)
    kinematics.update(q, v)
    bias = pin.nonLinearEffects(model, model.createData(), q, v)
    np.testing.assert_allclose(kinematics.bias, bias, atol=1e-12)


def test_turns_of_any_size():
    generator = np.random.default_rng(0)
    found = np.empty(3)
    for angle in (0.0, 1e-12, 1e-7, 1e-3, 1.0, 3.0, np.pi - 1e-6, np.pi):
        for _ in range(20):
            axis = generator.normal(size=3)
            axis /= np.linalg.norm(axis)
            start = pin.SE3.Random().rotation
            target = pin.exp3(angle * axis) @ start
            one, two = (frozen([*turn.reshape(-1), 0, 0, 0]) for turn in (start, target))
            place_turn(one, two, found)
            if angle < 3.14:
                np.testing.assert_allclose(found, angle * axis, atol=1e-8)
            np.testing.assert_allclose(pin.exp3(found) @ start, target, atol=1e-8)
