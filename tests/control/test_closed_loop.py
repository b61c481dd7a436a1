"""The leg on its point foot: lossy plant, what the controller knows of its gears decides."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    DisturbanceObserver,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
)
from wbc.dynamics import evaluate
from wbc.effects import PayloadMass, load_robot
from wbc.robot import Motion
from wbc.sim import Plant

LOSSY = load_robot("planar_leg_strong")
IDEAL = LOSSY.lossless()
ARM = replace(load_robot("planar_leg_fixed").lossless(), contacts=())
LOADED = ARM.with_effect(PayloadMass(ARM.bodies[-1], mass=1.0))
TARGET = ARM.configuration(hip=0.6, knee=0.5)


@cache
def standing_pose(knee):
    """Return q with the centre of mass over the foot."""

    def pose(hip):
        height = 0.4 * np.cos(hip) + 0.4 * np.cos(hip + knee)
        return LOSSY.configuration(hip=hip, knee=knee, base_z=height)

    def overhang(hip):
        terms = evaluate(LOSSY, pose(hip), np.zeros(5))
        return terms.data.com[0][0] - terms.contact_position[0, 0]

    return pose(brentq(overhang, -knee, 0.3))


def com_height(q):
    terms = evaluate(LOSSY, q, np.zeros(5))
    return float(terms.data.com[0][2])


def balancer(robot, **settings):
    tasks = [
        CenterOfMassTask(name="height", axes="z", weight=100.0, stiffness=400.0),
        PointFootBalanceTask(contact="foot", frame="base", weight=100.0),
        PostureTask.of(robot, weight=1e-3),
    ]
    return Controller(
        robot, tasks, [PointContact(name="foot")], settings=ControllerSettings(**settings)
    )


def squat(plant_robot, model, *, seconds=1.6, amplitude=0.025, noise=0.0, seed=0):
    """Return rms height error [m], worst pitch [rad] and the statuses of one squat."""
    generator = np.random.default_rng(seed)
    plant, controller = Plant(plant_robot), balancer(model)
    q = standing_pose(0.7)
    start = com_height(q)
    state, rate = plant.state(q), np.pi
    errors, pitch, usable = [], 0.0, True
    for tick in range(round(seconds / 1e-3)):
        time = 1e-3 * tick
        height = start + amplitude * (np.cos(rate * time) - 1.0)
        references = {
            "height": Reference(
                np.array([height]),
                np.array([-amplitude * rate * np.sin(rate * time)]),
                np.array([-amplitude * rate**2 * np.cos(rate * time)]),
            ),
            "balance": Reference(0.0),
        }
        measured = state.velocity + noise * generator.normal(size=5)
        command = controller.step(Motion(state.position, measured), references)
        usable = usable and command.status.usable
        state = plant.step(state, command.rotor_torque, 1e-3).state
        errors.append(com_height(state.position) - height)
        pitch = max(pitch, abs(state.position[2]))
    return float(np.sqrt(np.mean(np.square(errors)))), pitch, usable


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_squat_on_lossy_gears_is_as_good_as_on_ideal_ones(noise):
    ideal, _, sound = squat(IDEAL, IDEAL, noise=noise)
    ours, pitch, usable = squat(LOSSY, LOSSY, noise=noise)
    blind, _, _ = squat(LOSSY, IDEAL, noise=noise)
    assert sound
    assert usable
    assert pitch < 0.3
    assert ours <= 1.05 * ideal
    assert blind >= 3.0 * ideal


def held(observer, ticks=2500):
    """Return the error [rad] by tick of an arm that holds a load it does not know of."""
    controller = Controller(
        ARM, [PostureTask.of(ARM)], settings=ControllerSettings(disturbance=observer)
    )
    plant = Plant(LOADED)
    state, missed, learned = plant.state(TARGET), [], []
    for _ in range(ticks):
        command = controller.step(state, {"posture": Reference(TARGET)})
        assert command.status.usable
        state = plant.step(state, command.rotor_torque, 1e-3).state
        missed.append(np.abs(state.position - TARGET).max())
        learned.append(controller.disturbance)
    return np.array(missed), np.array(learned)


def test_a_constant_load_is_learned():
    without, nothing = held(None)
    missed, learned = held(DisturbanceObserver(rate=4.0, bound=50.0))
    assert not nothing.any()
    assert without[-1] > 1e-3
    assert missed[-1] < 0.02 * without[-1]
    rest = np.zeros(ARM.model.nv)
    true, believed = (
        pin.rnea(r.model, r.model.createData(), TARGET, rest, rest).copy() for r in (LOADED, ARM)
    )
    np.testing.assert_allclose(learned[-1], believed - true, rtol=0.02, atol=0.02)
    jumps = np.abs(np.diff(learned, axis=0)).max()
    assert jumps < 0.05 * np.abs(learned[-1]).max()


def test_what_is_learned_keeps_its_bound():
    _, learned = held(DisturbanceObserver(rate=4.0, bound=0.5), 800)
    assert np.abs(learned).max() == pytest.approx(0.5)


def test_noise_of_the_encoders_does_not_add_up():
    """What a velocity adds by its noise it takes away in the next tick."""
    controller = Controller(
        ARM,
        [PostureTask.of(ARM)],
        settings=ControllerSettings(disturbance=DisturbanceObserver(rate=2.0, bound=50.0)),
    )
    plant, generator = Plant(ARM), np.random.default_rng(0)
    state = plant.state(TARGET)
    for _ in range(600):
        noise = 0.01 * generator.normal(size=ARM.model.nv)
        seen = Motion(state.position, state.velocity + noise)
        command = controller.step(seen, {"posture": Reference(TARGET)})
        state = plant.step(state, command.rotor_torque, 1e-3).state
    assert np.abs(controller.disturbance).max() < 0.5
