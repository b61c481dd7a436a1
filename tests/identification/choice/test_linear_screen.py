"""A screen judges only what can still be the next best, and yields what judging all would yield."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import (
    EFFECTS,
    CoulombFriction,
    TransmissionEfficiency,
    ViscousFriction,
    load_robot,
)
from wbc.identification.choice.linear_screen import LinearScreen, screen
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()
HIDDEN = [TransmissionEfficiency("knee", 0.8, 0.9), CoulombFriction("hip", 0.5)]
AT_ONCE = [kind for name, kind in EFFECTS.items() if name not in ("joint_compliance", "backlash")]


@pytest.fixture(scope="module")
def screened() -> LinearScreen:
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, HIDDEN, duration=3.0))
    fit = problem.fit([ViscousFriction("hip", 0.1)])
    found, _ = screen(problem, fit, AT_ONCE, {("viscous_friction", "hip")})
    return found


def test_causes_come_in_the_order_of_what_they_leave(screened: LinearScreen) -> None:
    found = list(screened.best_first())
    errors = [subset.error for subset in found]
    assert errors == sorted(errors)
    single = {s.regressors[0]: s.error for s in found if len(s.regressors) == 1}
    judged = {k: screened.error((k,)) for k in range(len(screened.regressors))}
    assert single == {k: error for k, error in judged.items() if np.isfinite(error)}
    names = {
        screened.regressors[s.regressors[0]].effect.name for s in found if len(s.regressors) > 1
    }
    assert {"transmission_efficiency", "coulomb_friction"} <= names


def test_no_cause_leaves_less_than_its_bound(screened: LinearScreen) -> None:
    every = range(len(screened.regressors))
    groups = [screened.columns([k]) for k in every]
    nuisance = screened.columns([])
    own = [sorted(set(group) - set(nuisance)) for group in groups]
    bounds = screened.matrix.least_errors(own, nuisance)
    for k, group in enumerate(groups):
        assert bounds[k] <= screened.matrix.held_out(group) * (1.0 + 1e-9)


def test_the_best_is_found_without_judging_all(screened: LinearScreen) -> None:
    fresh = screened.instead_of([], np.zeros(0), screened.robot, ())
    best = next(fresh.best_first())
    assert best.error == min(s.error for s in screened.best_first())
    assert len(fresh._errors) < 0.5 * len(fresh.regressors)
