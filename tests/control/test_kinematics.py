"""What the controller evaluates by itself against pinocchio, which it does not ask for it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.arrays import frozen
from wbc.control.kinematics import Kinematics, StateRows, rows_of
from wbc.control.tree import RowKind, fill_state_rows, place_turn
from wbc.effects import load_robot
from wbc.robot import Robot, robot_names
from wbc.transmission import Transmission

WORLD, LOCAL = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, pin.ReferenceFrame.LOCAL
CLASSICAL = {RowKind.FRAME: (WORLD, pin.getFrameClassicalAcceleration)}
KINDS = CLASSICAL | {RowKind.OWN: (LOCAL, pin.getFrameAcceleration)}


def compare(robot, seed):
    generator, kinematics = np.random.default_rng(seed), Kinematics(robot)
    model, nv = kinematics.model, kinematics.model.nv
    data, rest = model.createData(), np.zeros(nv)
    q = pin.integrate(model, pin.neutral(model), generator.uniform(-1.0, 1.0, nv))
    v = 3.0 * generator.normal(size=nv)
    kinematics.update(q, v)
    bias = pin.rnea(model, data, q, v, rest).copy()
    close = {"atol": 1e-12 * (1.0 + np.abs(bias).max())}
    np.testing.assert_allclose(kinematics.bias, bias, **close)
    mass = pin.crba(model, data, q).reshape(nv, nv)
    np.testing.assert_allclose(kinematics.mass_matrix, mass, **close)
    pin.centerOfMass(model, data, q, v, rest)
    np.testing.assert_allclose(kinematics.center_of_mass(), data.com[0], atol=1e-12)
    com = StateRows(RowKind.CENTER_OF_MASS, "", slice(0, 3))
    whole = rows_of(model, [com], [0], np.zeros((3, nv)), np.zeros(3))
    fill_state_rows(kinematics.tree, whole, kinematics.mass)
    np.testing.assert_allclose(whole.drift, data.acom[0], atol=1e-10)
    jacobian = pin.jacobianCenterOfMass(model, data, q).reshape(3, nv)
    np.testing.assert_allclose(whole.jacobian, jacobian, atol=1e-12)
    pin.forwardKinematics(model, data, q, v, rest)
    pin.computeJointJacobians(model, data, q)
    frames = [f.name for f in model.frames if f.type == pin.FrameType.BODY][-4:]
    for kind, (axes, bends) in KINDS.items():
        jacobian, drift = np.zeros((6 * len(frames), nv)), np.zeros(6 * len(frames))
        rows = [StateRows(kind, name, slice(0, 6)) for name in frames]
        table = rows_of(model, rows, range(0, len(drift), 6), jacobian, drift)
        fill_state_rows(kinematics.tree, table, kinematics.mass)
        for i, name in enumerate(frames):
            number, part = model.getFrameId(name), slice(6 * i, 6 * i + 6)
            known = pin.getFrameJacobian(model, data, number, axes).reshape(6, nv)
            np.testing.assert_allclose(jacobian[part], known, atol=1e-12)
            bent = bends(model, data, number, axes).vector
            np.testing.assert_allclose(drift[part], bent, atol=1e-10)
            place = pin.updateFramePlacement(model, data, number)
            np.testing.assert_allclose(table.places[i, 9:], place.translation, atol=1e-12)
            np.testing.assert_allclose(table.places[i, :9].reshape(3, 3).T, place.rotation)


@pytest.mark.parametrize("name", robot_names())
def test_shipped_robots(name):
    compare(load_robot(name), 0)


def test_joints_whose_axes_move_in_their_bodies():
    """A ball joint by three angles: there the drifts come from pinocchio."""
    model = pin.Model()
    inertia = pin.Inertia.Random()
    ball = model.addJoint(0, pin.JointModelSphericalZYX(), pin.SE3.Random(), "ball")
    model.appendBodyToJoint(ball, inertia, pin.SE3.Identity())
    body = pin.FrameType.BODY
    model.addFrame(pin.Frame("upper", ball, 0, pin.SE3.Identity(), body))
    hinge = model.addJoint(ball, pin.JointModelRY(), pin.SE3.Random(), "hinge")
    model.appendBodyToJoint(hinge, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("lower", hinge, 0, pin.SE3.Random(), body))
    gears = Transmission(joints=("hinge",), gear_ratio=[10.0], rotor_inertia=[1e-4])
    compare(Robot("ball", model, gears), 1)


def test_turns_of_any_size():
    generator = np.random.default_rng(0)
    found = np.empty(3)
    for angle in (0.0, 1e-12, 1e-7, 1e-3, 1.0, 3.0, np.pi - 1e-6, np.pi):
        for _ in range(20):
            axis = generator.normal(size=3)
            axis /= np.linalg.norm(axis)
            start = pin.SE3.Random().rotation
            target = pin.exp3(angle * axis) @ start
            one, two = (frozen([*turn.T.reshape(-1), 0, 0, 0]) for turn in (start, target))
            place_turn(one, two, found)
            if angle < 3.14:
                np.testing.assert_allclose(found, angle * axis, atol=1e-8)
            np.testing.assert_allclose(pin.exp3(found) @ start, target, atol=1e-8)
