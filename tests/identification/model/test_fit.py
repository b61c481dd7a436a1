"""Fits: trials that fail, intervals, numbers drawn to a prior."""

import numpy as np
import pytest

from tests.moved import moved
from wbc import load_robot
from wbc.effects import Backlash, CenterOfMass, CoulombFriction, JointCompliance, ViscousFriction
from wbc.identification import diagnose
from wbc.identification.model.estimation_problem import (
    ALIKE,
    DISTORTED,
    EstimationProblem,
    alike_shifts,
)
from wbc.identification.model.fit import Fit, UsualRows
from wbc.measurement import Log
from wbc.robot import Parameter
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()


@pytest.fixture(scope="module")
def falling() -> list[Log]:
    """A log of a leg that stands on its head, which a soft gear cannot hold."""
    slow, fast = 2.0 * np.pi * np.array([0.5, 0.7])
    waves = [[(np.pi, 0.0, 0.5 * np.pi), (0.3, slow, 0.0)], [(0.0, 0.0, 0.0), (0.3, fast, 0.0)]]
    return [moved(LEG, np.arange(0.0, 20.0, 0.01), waves, (1e-5, 1e-3, 5e-4))]


def test_a_link_that_flies_off_loses_and_ends_nothing(falling: list[Log]) -> None:
    problem, soft = EstimationProblem.from_logs(LEG, falling), JointCompliance("hip", 1.0, 0.0)
    for start in ([soft], [soft, ViscousFriction("hip", 0.1)], [Backlash("hip", 0.01, 1.0, 0.0)]):
        fit = problem.fit(start)
        assert "flies off" in fit.failed
        assert "'hip'" in fit.failed
        assert fit.error == np.inf
        assert np.all(np.isinf(fit.held_out_residual()))
    assert not problem.fit([JointCompliance("hip", 5000.0, 10.0)]).failed


def test_a_diagnosis_survives_gears_that_hold_nothing(falling: list[Log]) -> None:
    short = [log.between(0.0, 5.0) for log in falling]
    found = diagnose(LEG, short, [JointCompliance, Backlash, ViscousFriction])
    assert np.isfinite(found.error.after)


def test_a_number_that_these_motions_cannot_show_is_not_told() -> None:
    robot = load_robot("planar_leg_fixed")
    logs = record_with(robot, [CenterOfMass("shin", 0.0, 0.0, 0.05)], duration=3.0)
    (finding,) = diagnose(robot, logs).findings
    assert finding.effect.name == "center_of_mass"
    assert "y" in finding.parameters
    assert set(finding.numbers) == {"x", "z"}
    assert "these logs do not tell y: it stays at 0 m" in finding.warnings
    assert finding.parameters["z"].high - finding.parameters["z"].low < 0.05


ROWS, FOLDS = 24, np.repeat([0, 1, 2], 8)


def linear_fit(rng: np.random.Generator, drawn: int, free: int) -> Fit:
    """Return a least-squares fit of two outputs by random columns, some drawn to zero."""
    p = drawn + free
    jacobian = rng.normal(size=(ROWS, 2, p))
    jacobian[FOLDS > 0, :, 0] *= 1e-3  # only the first fold tells the first number
    noise = np.array([0.5, 2.0])
    truth = rng.normal(size=p)
    truth[0] = 3.0
    raw = np.sqrt(noise) * rng.normal(size=(ROWS, 2)) - jacobian @ truth
    weights = 1.0 / np.sqrt(noise)
    usual = np.zeros((drawn, p))
    usual[:, :drawn] = np.diag(rng.uniform(0.5, 2.0, drawn))
    a = np.concatenate([(jacobian * weights[:, None]).reshape(-1, p), usual])
    b = np.concatenate([(raw * weights).ravel(), np.zeros(drawn)])
    step = np.linalg.lstsq(a, -b, rcond=None)[0]
    rows = UsualRows(usual @ step, usual, noise, np.ones(2))
    slots = tuple((0, Parameter("level", "1", 0.0, -9.0, 9.0, 1.0)) for _ in range(p))
    robot, effects = load_robot("simple_pendulum"), (CoulombFriction("joint", 0.1),)
    return Fit(robot, effects, raw + jacobian @ step, jacobian, slots, rows, folds=FOLDS)


def test_it_is_the_density_of_what_is_held_out_over_all_drawn_numbers() -> None:
    fit = linear_fit(np.random.default_rng(3), drawn=4, free=1)
    held = fit.held_out_residual()
    squares, cost = fit.usual.beside_open(held, fit.jacobian, fit.parts)
    noise, usual = fit.usual.noise, fit.usual.jacobian[:, :4]
    wanted = expected = 0.0
    for fold in range(3):
        inside = fold == FOLDS
        weighted = (fit.jacobian[~inside] / np.sqrt(noise)[:, None]).reshape(-1, 5)[:, :4]
        prior = np.linalg.inv(weighted.T @ weighted + usual.T @ usual)
        own = fit.jacobian[inside].reshape(-1, 5)[:, :4]
        variance = np.diag(np.tile(noise, inside.sum()))
        covariance = variance + own @ prior @ own.T
        r = held[inside].ravel()
        wanted += 0.5 * r @ np.linalg.solve(covariance, r)
        wanted += 0.5 * np.linalg.slogdet(covariance)[1] - 0.5 * np.linalg.slogdet(variance)[1]
        expected += 0.5 * np.sum(squares[inside] / noise)
    assert expected + cost == pytest.approx(wanted, rel=1e-9)
    assert cost > 0.0


def test_a_fold_that_alone_tells_a_drawn_number_is_no_miss() -> None:
    """Leaving it out predicted half of what is drawn: a rotor inertia took its place."""
    fit = linear_fit(np.random.default_rng(5), drawn=4, free=0)
    first = FOLDS == 0
    held = fit.held_out_residual()
    squares, _ = fit.usual.beside_open(held, fit.jacobian, fit.parts)
    assert (held[first] ** 2).mean() > 2.0 * fit.residual[first].var()
    assert squares[first].mean() < 1.5 * fit.residual[first].var()


def test_one_cause_moves_by_the_share_of_the_first_error_that_looks_like_it() -> None:
    robot, truth = load_robot("simple_pendulum"), ViscousFriction("pendulum", coefficient=0.3)
    sines = [[(0.5, 2.0 * np.pi * frequency, 0.0) for frequency in (0.4, 1.1)]]
    time = np.arange(0.0, 8.0, 0.004)
    log = moved(robot.with_effect(truth), time, sines, noise=(1e-6, 1e-5, 1e-4))
    problem = EstimationProblem.from_logs(robot, [log])
    fit = problem.fit([truth])
    scale = fit.parameters[0][1].scale
    (shift,) = alike_shifts(fit, problem.first, problem.row_noise(fit.residual)) * scale
    # The friction alone makes the first error.
    assert shift == pytest.approx(0.3 * ALIKE * DISTORTED, rel=0.02)
    assert problem.distortion(fit)[0] * scale >= 1.6 * shift
