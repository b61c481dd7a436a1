"""The plant with lossless gears against MuJoCo with armature N^2 I_r."""

from __future__ import annotations

import numpy as np
import pytest

from tests.reference.mujoco_leg import leg_model, run
from wbc import Robot, load_robot
from wbc.sim import Plant


def _robot() -> Robot:
    return load_robot("planar_leg_strong").lossless()


def _plant_run(robot: Robot, position, torque, step, duration) -> np.ndarray:
    plant = Plant(robot)
    state = plant.state(position)
    ratio = robot.transmission.gear_ratio
    for i in range(round(duration / step)):
        command = torque((i + 0.5) * step, state.position, state.velocity) / ratio
        state = plant.step(state, command, step).state
    return state.position


def _armature(robot: Robot) -> float:
    return float(robot.transmission.reflected_inertia[0])


def _swing(time, q, v):
    return np.array([4.0 * np.sin(9.0 * time), 3.0 * np.cos(7.0 * time)])


def test_free_motion_converges_to_mujoco_at_first_order() -> None:
    robot = _robot()
    start = robot.configuration(hip=0.4, knee=-0.9, base_z=5.0)
    model = leg_model(2.5e-5, armature=_armature(robot), ground=False, integrator="RK4")
    truth = run(model, start, _swing, 0.5)
    errors = [
        np.abs(_plant_run(robot, start, _swing, step, 0.5) - truth).max()
        for step in (2e-3, 1e-3, 5e-4)
    ]
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.05)
    assert errors[2] / errors[1] == pytest.approx(0.5, abs=0.05)
    assert errors[2] < 5e-3


def _standing(robot: Robot):
    start = robot.configuration(hip=-0.5, knee=1.0)
    start[1] = 2 * 0.4 * np.cos(0.5)
    driven = robot.actuated

    def squat(time, q, v):
        wish = start[driven] + np.array([-0.1, 0.2]) * np.sin(6.0 * time)
        return 400.0 * (wish - q[driven]) - 20.0 * v[driven]

    return start, squat


def test_sticking_contact_converges_to_mujoco() -> None:
    robot = _robot()
    start, squat = _standing(robot)
    gaps = []
    for step in (1e-3, 5e-4, 2.5e-4):
        ours = _plant_run(robot, start, squat, step, 0.4)
        model = leg_model(step, armature=_armature(robot), ground=True)
        theirs = run(model, start, squat, 0.4)
        gaps.append(np.abs(ours - theirs).max())
    assert gaps[1] / gaps[0] == pytest.approx(0.5, abs=0.05)
    assert gaps[2] / gaps[1] == pytest.approx(0.5, abs=0.05)
    assert gaps[2] < 1e-3
