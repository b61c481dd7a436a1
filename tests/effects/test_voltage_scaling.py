"""Drives whose torque follows the supply: the law, the plant's own voltage, the controller."""

from __future__ import annotations

import numpy as np

from wbc import Robot
from wbc.control import Controller, PostureTask
from wbc.effects import VoltageScaling
from wbc.robot import Motion
from wbc.sim import Plane, Plant

NOMINAL, SHARE = 48.0, 0.75
EFFECT = VoltageScaling("knee", SHARE, NOMINAL)


def supplied(leg: Robot, voltage: float) -> Robot:
    return leg.with_transmission(leg.transmission.replace(supply_voltage=np.full(2, voltage)))


def test_the_torque_follows_the_logged_voltage(leg: Robot) -> None:
    voltage = np.array([[48.0, 48.0], [48.0, 36.0], [36.0, 60.0], [48.0, np.nan]])
    motion = Motion(*np.zeros((2, 4, 2)), supply_voltage=voltage)
    given = np.ones((4, 2))
    left = EFFECT.drive(leg, motion, given)
    np.testing.assert_allclose(left[:, 0], 1.0)
    np.testing.assert_allclose(left[:, 1], [1.0, 1.0 - SHARE / 4.0, 1.0 + SHARE / 4.0, 1.0])
    np.testing.assert_allclose(EFFECT.drive_inverse(leg, motion, left), given)


def test_a_plant_and_a_controller_take_the_robots_own_voltage(leg: Robot) -> None:
    """On three quarters of the voltage the knee gets 1 - share / 4 of what is commanded."""
    start = leg.configuration(hip=0.4, knee=-0.9)
    low, factor = supplied(leg, 0.75 * NOMINAL).with_effect(EFFECT), 1.0 - SHARE / 4.0
    torque = np.array([0.1, 0.2])
    speeds = []
    for robot, given in ((low, torque), (leg, torque * [1.0, factor])):
        plant = Plant(robot, Plane(height=-9.0))
        speeds.append(plant.step(plant.state(start), given, 1e-3).state.velocity)
    np.testing.assert_allclose(speeds[0], speeds[1], rtol=1e-12)
    commands = []
    for robot in (low, leg):
        controller = Controller(robot, [PostureTask.of(robot)])
        commands.append(controller.step(Motion(start, np.array([0.5, -0.4]))).rotor_torque)
    np.testing.assert_allclose(commands[0], commands[1] / [1.0, factor], rtol=1e-9)
