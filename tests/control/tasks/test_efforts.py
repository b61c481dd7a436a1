"""Efforts choose among equal motions, force tasks among equal forces, levels among tasks."""

from __future__ import annotations

import numpy as np
import pytest

from tests.control.scenes import CERTAIN
from wbc.control import (
    CenterOfMassTask,
    ContactForceTask,
    Controller,
    ControllerSettings,
    JouleHeatEffort,
    MeshLossEffort,
    OutputTorqueEffort,
    PointContact,
    PostureTask,
    Reference,
    RotorTorqueEffort,
    SurfaceContact,
)
from wbc.effects import load_robot
from wbc.errors import ControlError
from wbc.robot import Motion

SOLO = load_robot("solo12")
STAND = next(iter(SOLO.poses.values()))
SETTINGS = ControllerSettings(speed_blend=CERTAIN)


def solo(*efforts, feet=None):
    names = [c.name for c in SOLO.contacts] if feet is None else feet
    tasks = [CenterOfMassTask(), PostureTask.of(SOLO, weight=0.01), *efforts]
    return Controller(SOLO, tasks, [PointContact(name=n) for n in names], settings=SETTINGS)


def moving():
    v = np.zeros(SOLO.model.nv)
    v[6:] = np.random.default_rng(0).normal(size=12) * 0.3
    return Motion(STAND, v)


def rotor_cost(command):
    return float(command.rotor_torque @ command.rotor_torque)


def output_cost(command):
    return float(command.output_torque @ command.output_torque)


def loss(command):
    motor = SOLO.transmission.motor_from_joint @ moving().velocity[SOLO.actuated]
    return float(np.sum(command.mesh_power - command.output_torque * motor))


CASES = {
    "rotor": (RotorTorqueEffort(weight=1.0), rotor_cost),
    "output": (OutputTorqueEffort(weight=1e-2), output_cost),
    "loss": (MeshLossEffort(weight=1.0), loss),
}


@pytest.mark.parametrize("case", CASES)
def test_effort_lowers_its_own_cost(case):
    effort, cost = CASES[case]
    plain, thrifty = solo(), solo(effort)
    for _ in range(5):
        before, after = plain.step(moving()), thrifty.step(moving())
    assert after.status.usable
    assert after.consistent
    assert cost(after) < 0.98 * cost(before)


def test_joule_heat_needs_the_motor_and_lowers_the_heat():
    gears = SOLO.transmission
    if np.isnan(gears.resistance).any():
        with pytest.raises(ControlError, match="resistance"):
            solo(JouleHeatEffort(weight=1.0))
    robot = SOLO.with_transmission(gears.replace(resistance=np.full(12, 0.3)))
    tasks = [CenterOfMassTask(), PostureTask.of(robot, weight=0.01)]
    contacts = [PointContact(name=c.name) for c in robot.contacts]
    plain = Controller(robot, tasks, contacts, settings=SETTINGS).step(moving())
    cool = Controller(
        robot, [*tasks, JouleHeatEffort(weight=0.1)], contacts, settings=SETTINGS
    ).step(moving())
    scale = 0.3 / robot.transmission.torque_constant**2

    def watts(command):
        return float(np.sum(scale * command.rotor_torque**2))

    assert watts(cool) < 0.98 * watts(plain)


def test_wrench_of_a_sole_is_tracked_where_the_other_can_carry_the_rest():
    """The asked wrench is reached, the tasks keep what they want, and the other sole gives way."""
    talos = load_robot("talos")
    ends = [f"sole_{a}_{b}" for a in ("front", "rear") for b in ("left", "right")]
    soles = [
        SurfaceContact(name=side, corners=tuple(f"{side}_{end}" for end in ends))
        for side in ("left", "right")
    ]
    still = Motion(talos.poses["half_sitting"], np.zeros(36))
    posture = PostureTask.of(talos)
    free = Controller(talos, [posture], soles, settings=SETTINGS).step(still)
    asked = free.forces["left"] + np.array([5.0, 3.0, 40.0, 1.0, -2.0, 0.5])
    task = ContactForceTask(name="load", contact="left", weight=1.0)
    control = Controller(talos, [posture, task], soles, settings=SETTINGS)
    command = control.step(still, {"load": Reference(asked)})
    np.testing.assert_allclose(command.forces["left"], asked, atol=0.1)
    change = command.forces["right"] - free.forces["right"]
    assert change[2] == pytest.approx(-40.0, abs=2.0)
