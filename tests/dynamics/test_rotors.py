"""Rotor coupling against pinocchio models in which every rotor is a body on a joint of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from wbc.arrays import FloatArray
from wbc.dynamics import evaluate, redundant_model, rotor_torque
from wbc.dynamics.batch import link_torque
from wbc.effects import load_robot
from wbc.errors import RobotError
from wbc.robot import Motion, Robot

NAMES = ["planar_leg", "parallelogram_leg", "differential_biped", "solo12", "staubli_tx40"]
MASS, ACROSS = 0.2, 3e-4


def rotor_body(axis: FloatArray, spin: float) -> pin.Inertia:
    """Return a rotor about `axis`: symmetric, with a mass and an inertia across the axis too."""
    moment = ACROSS * np.eye(3) + (spin - ACROSS) * np.outer(axis, axis)
    return pin.Inertia(MASS, np.zeros(3), moment)


def with_real_rotors(robot: Robot) -> tuple[pin.Model, list[int]]:
    """Return the links with one revolute joint and body per rotor, and the order of s in it."""
    model, gears = pin.Model(), robot.transmission
    model.gravity = robot.model.gravity
    new = {0: 0}
    for number in range(robot.model.njoints):
        if number:
            new[number] = model.addJoint(
                new[robot.model.parents[number]],
                robot.model.joints[number].copy()
                if hasattr(robot.model.joints[number], "copy")
                else robot.model.joints[number],
                robot.model.jointPlacements[number],
                robot.model.names[number],
            )
            model.appendBodyToJoint(new[number], robot.model.inertias[number], pin.SE3.Identity())
        # Rotors are leaves right behind their housing, so that subtrees stay contiguous.
        for gear in np.flatnonzero(robot.mounting.housing == number):
            axis = robot.mounting.axis[gear]
            joint = model.addJoint(
                new[number],
                pin.JointModelRevoluteUnaligned(*axis),
                pin.SE3.Identity(),
                f"rotor:{gears.joints[gear]}",
            )
            body = rotor_body(axis, gears.rotor_inertia[gear])
            model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    order: list[int] = []
    for number in range(1, robot.model.njoints):
        start = model.joints[new[number]].idx_v
        order += range(start, start + robot.model.joints[number].nv)
    order += [model.joints[model.getJointId(f"rotor:{j}")].idx_v for j in gears.joints]
    return model, order


def configuration(robot: Robot, real: pin.Model, q: FloatArray) -> FloatArray:
    """Return q of the model with rotors for q of the links."""
    full = pin.neutral(real)
    for number in range(1, robot.model.njoints):
        joint = robot.model.joints[number]
        there = real.joints[real.getJointId(robot.model.names[number])]
        full[there.idx_q : there.idx_q + joint.nq] = q[joint.idx_q : joint.idx_q + joint.nq]
    return full


def carrying(robot: Robot) -> Robot:
    """Return the robot whose links hold their rotors at standstill, as the library asks."""
    loaded = replace(robot, rotors_turn_with_links=True)
    for gear, housing in enumerate(robot.mounting.housing.tolist()):
        if housing:
            body = rotor_body(robot.mounting.axis[gear], robot.transmission.rotor_inertia[gear])
            loaded = loaded.with_inertia(housing, loaded.model.inertias[housing] + body)
    return loaded


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", [0, 1])
def test_redundant_inertia_and_bias_are_those_of_real_rotor_joints(
    name: str, seed: int, random_state
) -> None:
    robot = load_robot(name)
    real, order = with_real_rotors(robot)
    ours = carrying(robot)
    q, v = random_state(ours, seed)
    model = redundant_model(ours, evaluate(ours, q, v))
    s_dot = model.nullspace @ v
    data = real.createData()
    full_q, full_v = configuration(robot, real, q), np.zeros(real.nv)
    full_v[order] = s_dot
    mass = pin.crba(real, data, full_q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    np.testing.assert_allclose(model.inertia, mass[np.ix_(order, order)], atol=1e-9)
    bias = pin.nonLinearEffects(real, data, full_q, full_v)
    np.testing.assert_allclose(model.bias, bias[order], atol=1e-8)


@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg", "solo12"])
def test_inverse_dynamics_with_coupling_is_that_of_real_rotor_joints(
    name: str, random_state
) -> None:
    robot = load_robot(name).lossless()
    real, order = with_real_rotors(robot)
    ours = carrying(robot)
    q, v = random_state(ours, 3)
    a = np.random.default_rng(4).normal(size=robot.model.nv)
    nullspace = redundant_model(ours, evaluate(ours, q, v)).nullspace
    full_v, full_a = np.zeros((2, real.nv))
    full_v[order], full_a[order] = nullspace @ v, nullspace @ a
    whole = configuration(robot, real, q), full_v, full_a
    effort = pin.rnea(real, real.createData(), *whole)[order]
    # Perfect gears: the rotor torque does the work of everything that moves with the joint.
    nv, gears = robot.model.nv, robot.transmission
    needed = nullspace.T @ effort
    tau = np.linalg.solve(gears.distribution, needed[robot.actuated])
    motion = Motion(q[None], v[None], a[None])
    found, rest = rotor_torque(ours, motion, link_torque(ours, motion))
    np.testing.assert_allclose(found[0], tau, atol=1e-9)
    np.testing.assert_allclose(rest[0], needed[:nv][robot.unactuated], atol=1e-9)


def test_a_housing_that_does_not_exist_is_named() -> None:
    robot = load_robot("planar_leg")
    gears = robot.transmission.replace(housings=("base", "tigh"))
    with pytest.raises(RobotError, match="Did you mean 'thigh'"):
        _ = robot.with_transmission(gears).mounting
