"""A trial that is not finite loses: it ends neither a fit nor a diagnosis."""

from __future__ import annotations

import numpy as np
import pytest

from wbc import Robot, load_robot
from wbc.effects import Backlash, JointCompliance, ViscousFriction
from wbc.identification import diagnose
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log


@pytest.fixture(scope="module")
def leg() -> Robot:
    return load_robot("planar_leg_fixed").lossless()


def _falling(leg: Robot, seconds: float) -> list[Log]:
    """Return a log of a leg that stands on its head, which a soft gear cannot hold."""
    time = np.arange(0.0, seconds, 0.01)
    random = np.random.default_rng(0)
    columns = {}
    for k, joint in enumerate(leg.transmission.joints):
        angle = 2.0 * np.pi * (0.5 + 0.2 * k) * time
        rate = 2.0 * np.pi * (0.5 + 0.2 * k)
        columns[f"{joint}.position"] = 0.3 * np.sin(angle) + (np.pi if k == 0 else 0.0)
        columns[f"{joint}.velocity"] = 0.3 * rate * np.cos(angle)
        columns[f"{joint}.motor_torque"] = 5.0 * np.sin(angle + 1.0)
        for name, size in (("position", 1e-5), ("velocity", 1e-3), ("motor_torque", 1e-2)):
            columns[f"{joint}.{name}"] += size * random.standard_normal(time.size)
    return [Log(time, columns)]


def test_a_link_that_flies_off_loses_and_ends_nothing(leg: Robot) -> None:
    problem = EstimationProblem.from_logs(leg, _falling(leg, 200.0))
    for start in (
        [JointCompliance("hip", 1.0, 0.0)],
        [JointCompliance("hip", 1.0, 0.0), ViscousFriction("hip", 0.1)],
        [Backlash("hip", 0.01, 1.0, 0.0)],
    ):
        fit = problem.fit(start)
        assert "flies off" in fit.failed
        assert "'hip'" in fit.failed
        assert fit.error == np.inf
        assert np.all(np.isinf(fit.held_out_residual(problem.folds)))
    assert not problem.fit([JointCompliance("hip", 5000.0, 10.0)]).failed


def test_a_diagnosis_survives_gears_that_hold_nothing(leg: Robot) -> None:
    found = diagnose(
        leg, _falling(leg, 5.0), candidates=[JointCompliance, Backlash, ViscousFriction]
    )
    assert np.isfinite(found.error.after)
