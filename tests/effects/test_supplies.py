"""Supplies that sag or are logged: the torque that a drive gives at its voltage."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from wbc.control import Controller, PostureTask
from wbc.effects import SupplySag, VoltageScaling, load_robot
from wbc.robot import Motion, Robot
from wbc.sim import Plane, Plant

KT, OHM, GEAR = 0.11, 0.35, 12.0


@pytest.fixture
def plain() -> Robot:
    return load_robot("planar_leg_fixed").lossless()


@pytest.fixture
def wound(plain: Robot) -> Robot:
    gears = plain.transmission
    for joint in plain.joints:
        for name, value in (("torque_constant", KT), ("resistance", OHM), ("gear_ratio", GEAR)):
            gears = gears.with_value(name, joint, value)
    return plain.with_transmission(gears)


def at_speed(hip: float, knee: float) -> Motion:
    return Motion(np.zeros((1, 2)), np.array([[hip, knee]]))


def test_a_stalled_motor_draws_what_warms_its_winding(plain: Robot, wound: Robot) -> None:
    sag, still = SupplySag("robot", 0.002), at_speed(0.0, 0.0)
    torque = np.array([[0.9, -0.6]])
    heat = OHM * (0.9**2 + 0.6**2) / KT**2
    np.testing.assert_allclose(sag.drive(wound, still, torque), torque * (1.0 - 0.002 * heat))
    # Nothing is known of the winding: only torque times speed can be counted.
    np.testing.assert_array_equal(sag.drive(plain, still, torque), torque)


def test_a_braking_motor_feeds_the_other_before_the_supply_does(wound: Robot) -> None:
    sag, torque = SupplySag("robot", 0.002), np.array([[0.2, -0.2]])
    heat = OHM * 2 * 0.2**2 / KT**2
    for knee, power in ((1.0, 0.2 * GEAR * 2.0 + heat), (50.0, 0.0)):
        drawn = sag.drive(wound, at_speed(3.0, knee), torque)
        np.testing.assert_allclose(drawn, torque * (1.0 - 0.002 * power))


@pytest.mark.parametrize("coefficient", [0.0, 0.0005, 0.002])
def test_the_reported_torque_is_the_smallest_that_delivers(
    coefficient: float, wound: Robot
) -> None:
    sag, rng = SupplySag("robot", coefficient), np.random.default_rng(4)
    for _ in range(20):
        motion = at_speed(*rng.uniform(-6.0, 6.0, 2))
        torque = rng.uniform(-0.7, 0.7, (1, 2))
        size = float(np.linalg.norm(torque))

        def short(
            drive: float,
            motion: Motion = motion,
            along: np.ndarray = torque / size,
            size: float = size,
        ) -> float:
            return float(np.linalg.norm(sag.drive(wound, motion, drive * along))) - size

        drives = np.linspace(0.0, 3.0, 3001)
        first = int(np.argmax([short(drive) > 0.0 for drive in drives]))
        assert first > 0
        truth = brentq(short, drives[first - 1], drives[first])
        found = sag.drive_inverse(wound, motion, torque)
        np.testing.assert_allclose(found, truth * torque / size, rtol=1e-6)
        np.testing.assert_allclose(sag.drive(wound, motion, found), torque, rtol=1e-9)


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
