"""The leg on its point foot: lossy plant, what the controller knows of its gears decides."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
)
from wbc.dynamics import evaluate
from wbc.effects import load_robot
from wbc.robot import Motion
from wbc.sim import Plant

LOSSY = load_robot("planar_leg_strong")
IDEAL = LOSSY.lossless()


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
