"""Held-out squares where numbers are drawn to a prior, held against the Gaussian density."""

from __future__ import annotations

import numpy as np
import pytest

from wbc import load_robot
from wbc.arrays import FloatArray
from wbc.effects import CoulombFriction
from wbc.identification.model.fit import Fit
from wbc.identification.model.information import UsualRows
from wbc.robot import Parameter

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
    slots = tuple((0, Parameter(f"p{k}", "1", 0.0, -9.0, 9.0, 1.0)) for k in range(p))
    robot, effects = load_robot("simple_pendulum"), (CoulombFriction("joint", 0.1),)
    return Fit(robot, effects, raw + jacobian @ step, jacobian, slots, rows)


def beside_open(fit: Fit) -> tuple[FloatArray, float]:
    return fit.usual.beside_open(fit.held_out_residual(FOLDS), fit.jacobian, FOLDS)


def test_it_is_the_density_of_what_is_held_out_over_all_drawn_numbers() -> None:
    fit = linear_fit(np.random.default_rng(3), drawn=4, free=1)
    squares, cost = beside_open(fit)
    held = fit.held_out_residual(FOLDS)
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
    squares, _ = beside_open(fit)
    assert (fit.held_out_residual(FOLDS)[first] ** 2).mean() > 2.0 * fit.residual[first].var()
    assert squares[first].mean() < 1.5 * fit.residual[first].var()


def test_numbers_that_the_logs_tell_are_counted_by_how_predictions_follow_them() -> None:
    """The degrees of freedom of a fit are the trace of d prediction / d data (Ye, 1998)."""
    fit = linear_fit(np.random.default_rng(6), drawn=4, free=2)
    a, usual = fit.usual.weighted(fit.jacobian), fit.usual.jacobian
    follows = a @ np.linalg.solve(a.T @ a + usual.T @ usual, a.T)
    assert 6.0 - fit.untold.sum() == pytest.approx(np.trace(follows), rel=1e-6)
    assert 5.0 < np.trace(follows) < 6.0
