"""A name that is believed has a number of its own; the model to use may hold another one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.recover.plant import dragging_knee
from wbc.effects import DirectionalViscousFriction, ViscousFriction, load_robot
from wbc.identification import diagnose
from wbc.identification.answer.findings import describe_findings
from wbc.identification.answer.model_to_use import judged
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem

KEY = ("viscous_friction", "knee")


def test_a_doubtful_cause_does_not_change_the_number_of_a_certain_one() -> None:
    """It was printed, certain, with the part of the torque that the doubtful cause left it."""
    robot = load_robot("planar_leg_fixed").lossless()
    diagnosis = diagnose(robot, [dragging_knee()], [ViscousFriction])
    trials = Trials(EstimationProblem.from_logs(robot, [dragging_knee()]))
    alone = trials.of([ViscousFriction("knee", 0.5)])
    # The two are the same torque where both directions drag alike: the fit keeps how they share it.
    both = trials.of([ViscousFriction("knee", 0.1), DirectionalViscousFriction("knee", 0.4, 0.4)])
    assert alone is not None
    assert both is not None
    names, used = judged(trials, alone, set()), judged(trials, both, set())
    doubt = replace(used.support[both.keys[1]], odds=0.1, group=0.1)
    answer = replace(used, named=alone, support={both.keys[1]: doubt, **names.support})
    found = {f.effect.key: f for f in describe_findings(trials, answer)}
    assert list(found) == list(both.keys)
    number = found[KEY].parameters["coefficient"]
    assert number.value == pytest.approx(0.5, rel=0.01)
    assert number.low < 0.5 < number.high
    assert number.used == both.effects[0].values["coefficient"] < number.low
    told = replace(diagnosis, findings=tuple(found.values()), robot=trials.fit(both).robot)
    assert "in the model to use" in str(told)
    low, high = told.intervals()[*KEY, "coefficient"]
    assert low == number.used
    assert high == number.high
    assert told.to_json()["effects"][0]["parameters"]["coefficient"]["used"] == number.used
    # What the model lacks is named all the same, and where it has the number nothing is said.
    lacking = describe_findings(trials, replace(used, hypothesis=trials.nothing, named=alone))
    assert "predicts better without it" in lacking[0].warnings[0]
    same = describe_findings(trials, names)
    assert same[0].parameters["coefficient"].used is None
