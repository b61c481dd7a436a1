"""Intervals are never narrower than what filters distort in the likeness of a cause."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import CoulombFriction, ViscousFriction, load_robot
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.intervals import ALIKE, DISTORTED, alike_shifts
from wbc.measurement import Log
from wbc.robot import Effect, Motion

ROBOT = load_robot("simple_pendulum")


def fitted(*effects: Effect) -> tuple[EstimationProblem, Fit]:
    """Return a pendulum's log with these effects, and their fit."""
    time = np.arange(0.0, 8.0, 0.004)
    rates = 2.0 * np.pi * np.array([0.4, 1.1])
    q, v, a = (
        sum(0.5 * w**k * np.sin(w * time + 0.5 * np.pi * k) for w in rates)[:, None]
        for k in range(3)
    )
    robot, motion = ROBOT.with_effects(*effects), Motion(q, v, a)
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    noise = np.random.default_rng(0).standard_normal((3, len(time)))
    columns = {
        "pendulum.position": q[:, 0] + 1e-6 * noise[0],
        "pendulum.velocity": v[:, 0] + 1e-5 * noise[1],
        "pendulum.rotor_torque": torque[:, 0] + 1e-4 * noise[2],
    }
    problem = EstimationProblem.from_logs(ROBOT, [Log(time, columns)])
    return problem, problem.fit(effects)


def test_one_cause_moves_by_the_share_of_the_first_error_that_looks_like_it() -> None:
    truth = ViscousFriction("pendulum", coefficient=0.3)
    problem, fit = fitted(truth)
    scale = fit.parameters[0][1].scale
    (shift,) = alike_shifts(fit, problem.first, problem.row_noise(fit.residual)) * scale
    # The friction alone makes the first error.
    assert shift == pytest.approx(0.3 * ALIKE * DISTORTED, rel=0.02)
    assert problem.distortion(fit)[0] * scale >= 1.6 * shift


def test_two_causes_that_look_alike_move_by_more() -> None:
    pair = ViscousFriction("pendulum", coefficient=0.3), CoulombFriction("pendulum", level=0.2)
    problem, fit = fitted(*pair)
    both = alike_shifts(fit, problem.first, problem.row_noise(fit.residual))
    columns = fit.jacobian.reshape(-1, 2)
    others = columns[:, ::-1]
    left = columns - others * np.sum(columns * others, axis=0) / np.sum(others**2, axis=0)
    size = np.sqrt(np.mean(left**2, axis=0))
    expected = ALIKE * DISTORTED * np.sqrt(problem.first[0] - 1.0) / size
    np.testing.assert_allclose(both, expected, rtol=1e-6)
