"""Feet that land or part slowly stay rows of a step."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc import Robot
from wbc.robot import ContactPoint
from wbc.sim import Plant
from wbc.transmission import Transmission

LINK, BENT, DT = 0.2, 0.6, 1e-3  # [m], [rad], [s]
AXES = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRY)


def legged(legs: int) -> Robot:
    """Return a body on legs of three lossy gears, in two rows; each foot has two points."""
    model, joints, contacts = pin.Model(), [], []
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    # As heavy as its legs.
    body = pin.Inertia.FromBox(2.0 * legs, 0.2 * legs, 0.3, 0.1)
    model.appendBodyToJoint(base, body, pin.SE3.Identity())
    for leg in range(legs):
        side = np.array([0.2 * (leg // 2 - (legs - 2) / 4.0), 0.15 * (-1.0) ** leg, 0.0])
        parent, place = base, pin.SE3(np.eye(3), side)
        for number, axis in enumerate(AXES):
            joints.append(f"leg_{leg}_{number}")
            parent = model.addJoint(parent, axis(), place, joints[-1])
            link = pin.Inertia.FromBox(0.3, 0.05, 0.05, LINK if number else 0.05)
            down = np.array([0.0, 0.0, -LINK if number else 0.0])
            link.lever = 0.5 * down
            model.appendBodyToJoint(parent, link, pin.SE3.Identity())
            place = pin.SE3(np.eye(3), down)
        model.addBodyFrame(f"foot_{leg}", parent, pin.SE3.Identity(), 0)
        for k, x in enumerate((0.02, -0.02)):
            contacts.append(ContactPoint(f"point_{leg}_{k}", f"foot_{leg}", [x, 0.0, -LINK]))
    one = np.ones(len(joints))
    gears = Transmission(
        tuple(joints), 9.0 * one, 2e-5 * one, forward_efficiency=0.85 * one, torque_limit=3.0 * one
    )
    return Robot("legged", model, gears, tuple(contacts))


def test_feet_that_rock_split_no_step() -> None:
    """As impacts of their own they made up to 7 parts of a step."""
    robot = legged(20)
    pose = robot.neutral()
    driven, gears = robot.actuated_position, robot.transmission
    pose[driven] = np.tile([0.0, BENT, -BENT], 20)
    pose[2] = LINK * (1.0 + np.cos(BENT))
    plant = Plant(robot)
    state, impacts = plant.state(pose), 0
    for k in range(40):
        error = state.position[driven] - pose[driven] + 0.025 * state.velocity[robot.actuated]
        result = plant.step(state, -60.0 * error / gears.gear_ratio, DT)
        state = result.state
        if k < 20:
            continue  # it comes to rest on its feet
        impacts += len(result.impacts)
        assert len(result.parts) == 1
        assert {part.solution.method for part in result.parts} == {"newton"}
        assert not [event for event in result.events if event.kind == "energy"]
    assert impacts > 3
    weight = 9.81 * pin.computeTotalMass(robot.model)
    assert result.contact_force[:, 2].sum() == pytest.approx(weight, rel=0.2)
