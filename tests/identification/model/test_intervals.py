"""What the logs do not tell of a number has no narrow interval."""

from __future__ import annotations

import numpy as np
import pytest

from wbc import load_robot
from wbc.effects import CenterOfMass
from wbc.identification import diagnose
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.intervals import interval_bounds
from wbc.measurement import Log
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed")


@pytest.fixture(scope="module")
def logs() -> tuple[Log, ...]:
    return record_with(LEG, [CenterOfMass("shin", 0.0, 0.0, 0.05)], duration=3.0)


def test_a_number_that_these_motions_cannot_show_may_be_anything(logs: tuple[Log, ...]) -> None:
    problem = EstimationProblem.from_logs(LEG, logs)
    fit = problem.fit([CenterOfMass("shin", 0.0, 0.0, 0.05)])
    bounds = interval_bounds(fit, problem.blocks, problem.distortion(fit))
    of = {parameter.name: ends for (_, parameter), ends in zip(fit.parameters, bounds, strict=True)}
    across = next(p for p in CenterOfMass.parameters if p.name == "y")
    np.testing.assert_array_equal(of["y"], [across.low, across.high])
    assert np.ptp(of["z"]) < 0.05


def test_the_answer_says_which_numbers_it_does_not_know(logs: tuple[Log, ...]) -> None:
    (finding,) = diagnose(LEG, logs).findings
    assert finding.effect.name == "center_of_mass"
    assert "y" in finding.parameters
    assert set(finding.numbers) == {"x", "z"}
    assert "these logs do not tell y: it stays at 0 m" in finding.warnings
