"""Two soft gears in one leg, against an ODE solver that shares no code with the library."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from wbc.effects import JointCompliance, PayloadMass, load_robot
from wbc.identification.problem import Problem
from wbc.measurement import Log
from wbc.robot import Effect

MASS, LENGTH, REFLECTED, RATIO, GRAVITY = 2.0, 0.4, 0.02666666666666667, 20.0, 9.81
TIME = np.arange(0.0, 4.0, 0.002)
FREQUENCY = np.array([[0.7, 1.9, 3.1], [0.5, 1.6, 3.7]])  # [Hz]
SIZE = np.array([[0.35, 0.1, 0.04], [0.4, 0.12, 0.05]])  # [rad]


def _motors(t: float | np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Return position, velocity and acceleration of both motors, (3, 2, ...)."""
    rate = 2.0 * np.pi * FREQUENCY[..., None]
    angle = rate * np.asarray(t).reshape(1, 1, -1) + phase[..., None]
    size = SIZE[..., None]
    parts = (size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle))
    moved = np.array([part.sum(axis=1) for part in parts])
    moved[0] += np.array([[0.45], [-0.8]])
    return moved


def _links(q: np.ndarray, v: np.ndarray, foot: float) -> tuple[np.ndarray, np.ndarray]:
    """Return mass matrix (2, 2) and bias (2,) of two rods with a point mass at the end."""
    rod, half = MASS * LENGTH**2 / 12.0, 0.5 * LENGTH
    first, second = MASS * half + foot * LENGTH, rod + MASS * half**2 + foot * LENGTH**2
    cross = LENGTH * first * np.cos(q[1])
    far = rod + MASS * half**2 + (MASS + foot) * LENGTH**2
    mass = np.array([[far + second + 2 * cross, second + cross], [second + cross, second]])
    h = -LENGTH * first * np.sin(q[1])
    upper = (MASS * half + (MASS + foot) * LENGTH) * GRAVITY * np.sin(q[0])
    lower = first * GRAVITY * np.sin(q[0] + q[1])
    bias = np.array([h * (2 * v[0] * v[1] + v[1] ** 2) + upper + lower, -h * v[0] ** 2 + lower])
    return mass, bias


def _log(stiffness: np.ndarray, damping: np.ndarray, foot: float, seed: int) -> Log:
    random = np.random.default_rng(seed)
    phase = random.uniform(0.0, 2.0 * np.pi, FREQUENCY.shape)

    def held(t: float, state: np.ndarray) -> np.ndarray:
        position, velocity, _ = _motors(t, phase)[..., 0]
        return stiffness * (position - state[:2]) + damping * (velocity - state[2:])

    def rate(t: float, state: np.ndarray) -> np.ndarray:
        mass, bias = _links(state[:2], state[2:], foot)
        return np.concatenate([state[2:], np.linalg.solve(mass, held(t, state) - bias)])

    begin = _motors(0.0, phase)[:2, :, 0]
    start = np.concatenate([begin[0] - (0.02, 0.01), begin[1]])
    span = (0.0, float(TIME[-1]))
    path = solve_ivp(rate, span, start, t_eval=TIME, rtol=1e-7, atol=1e-9, max_step=5e-3).y
    passed = np.array([held(t, state) for t, state in zip(TIME, path.T, strict=True)])
    position, velocity, acceleration = (part.T for part in _motors(TIME, phase))
    torque = (passed + REFLECTED * acceleration) / RATIO
    columns = {}
    for j, joint in enumerate(("hip", "knee")):
        noise = random.standard_normal((3, TIME.size))
        columns[f"{joint}.position"] = position[:, j] + 2e-5 * noise[0]
        columns[f"{joint}.velocity"] = velocity[:, j] + 3e-3 * noise[1]
        columns[f"{joint}.rotor_torque"] = torque[:, j] + 2e-3 * noise[2]
    return Log(TIME, columns)


@pytest.mark.parametrize(
    ("springs", "foot", "begun"),
    [
        (
            ((800.0, 5.0), (300.0, 1.5)),
            0.0,
            (JointCompliance("hip", 700.0, 4.0), JointCompliance("knee", 340.0, 2.0)),
        ),
        (
            ((400.0, 3.0), (200.0, 1.0)),
            0.1,
            (
                JointCompliance("hip", 440.0, 3.0),
                JointCompliance("knee", 190.0, 1.0),
                PayloadMass("foot", 0.05),
            ),
        ),
    ],
)
def test_two_soft_gears_are_told_apart(
    springs: tuple[tuple[float, float], ...], foot: float, begun: tuple[Effect, ...]
) -> None:
    stiffness, damping = np.array(springs).T
    logs = [_log(stiffness, damping, foot, seed) for seed in (3, 4)]
    problem = Problem.from_logs(load_robot("planar_leg_fixed").lossless(), logs)
    fit = problem.fit(begun)
    assert fit.error < 1.3
    for effect, (k, c) in zip(fit.effects, springs, strict=False):
        assert effect.values["stiffness"] == pytest.approx(k, rel=0.01)
        assert effect.values["damping"] == pytest.approx(c, rel=0.1)
    for effect in fit.effects[2:]:
        assert effect.values["mass"] == pytest.approx(foot, rel=0.02)
