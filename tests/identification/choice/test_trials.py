"""Fits that end early, and what they may and may not decide."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import pytest

from wbc.arrays import FloatArray
from wbc.effects import CoulombFriction, TorqueOffset, ViscousFriction, load_robot
from wbc.identification.answer.diagnosis import believed as believed_module
from wbc.identification.choice.find_causes import SearchResult
from wbc.identification.choice.weighing.certainty import Support, support_of
from wbc.identification.choice.weighing.evidence import weigh
from wbc.identification.choice.weighing.hypothesis import Hypothesis, Key
from wbc.identification.choice.weighing.odds import Odds
from wbc.identification.choice.weighing.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.robot import Effect
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()
HIDDEN: list[Effect] = [CoulombFriction("hip", 0.5), ViscousFriction("knee", 0.3)]


@pytest.fixture(scope="module")
def problem() -> EstimationProblem:
    return EstimationProblem.from_logs(LEG, record_with(LEG, HIDDEN, duration=4.0))


def counted(trials: Trials, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the list into which each fit's number of steps will go."""
    steps: list[int] = []
    fit = EstimationProblem.fit

    def counting(problem: EstimationProblem, effects: object, iterations: int = 99) -> object:
        steps.append(iterations)
        return fit(problem, effects, iterations)  # type: ignore[arg-type]

    monkeypatch.setattr(EstimationProblem, "fit", counting)
    return steps


def test_what_is_far_behind_ends_after_one_step(
    problem: EstimationProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two hundred fits that could not win took half of a quadruped's diagnosis."""
    trials = Trials(problem)
    best = trials.of(HIDDEN)
    assert best is not None
    steps = counted(trials, monkeypatch)
    (far,) = trials.rivals_of(best, [[TorqueOffset("hip", 0.1), HIDDEN[1]]])
    assert steps == [1]
    own, other = weigh(problem, [best, far])
    assert other < own - 20.0
    assert trials.of([TorqueOffset("hip", 0.1), HIDDEN[1]]) is far


def test_what_is_near_is_fitted_to_its_end(
    problem: EstimationProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    trials = Trials(problem)
    weak = trials.of([TorqueOffset("hip", 0.1)])
    assert weak is not None
    steps = counted(trials, monkeypatch)
    (better,) = trials.rivals_of(weak, [HIDDEN])
    assert steps[0] == 1
    assert len(steps) == 2
    assert steps[1] > 1
    assert trials.ended(better) is better


def test_an_answer_is_fitted_to_its_end(problem: EstimationProblem) -> None:
    trials = Trials(problem)
    best = trials.of(HIDDEN)
    assert best is not None
    (begun,) = trials.rivals_of(best, [[TorqueOffset("hip", 0.1), ViscousFriction("knee", 3.0)]])
    ended = trials.ended(begun)
    assert ended is not begun
    assert weigh(problem, [begun, ended])[1] >= weigh(problem, [begun, ended])[0] - 1e-9
    assert trials.ended(ended) is ended


def test_what_a_doubted_cause_kept_out_comes_back(problem: EstimationProblem) -> None:
    """A torque ripple, not believed, stood where a rotor inertia belongs (double pendulum)."""
    trials = Trials(problem)
    final = trials.of([TorqueOffset("hip", 0.1), HIDDEN[1]])
    true = trials.of(HIDDEN)
    assert final is not None
    assert true is not None
    answer = believed_module.best_without(trials, final, {("torque_offset", "hip")})
    assert answer is true
    assert believed_module.best_without(trials, true, set()) is true


def test_a_cause_is_judged_again_without_one_that_is_less_believed(
    problem: EstimationProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A link's inertia and a rotor's shared what they explain, and both went (double pendulum)."""
    rival = TorqueOffset("hip", 0.1)
    trials = Trials(problem)
    final = trials.of([*HIDDEN, rival])
    assert final is not None

    def shared(
        trials: Trials, h: Hypothesis, odds: Odds, excess: FloatArray, explained: bool
    ) -> dict[Key, Support]:
        found = support_of(trials, h, odds, excess, explained)
        beside: Collection[Key] = (HIDDEN[0].key, rival.key) if rival.key in h.keys else ()
        given = {HIDDEN[0].key: 0.6, rival.key: 0.5}
        return {
            key: replace(one, odds=given[key], group=given[key]) if key in beside else one
            for key, one in found.items()
        }

    monkeypatch.setattr(believed_module, "support_of", shared)
    monkeypatch.setattr(
        believed_module,
        "best_without",
        lambda trials, h, doubted: _final_without(trials, final, doubted),
    )
    answer = believed_module.believed(SearchResult(trials, (), final)).hypothesis
    assert {*answer.keys} == {effect.key for effect in HIDDEN}


def _final_without(trials: Trials, final: Hypothesis, doubted: Collection[Key]) -> Hypothesis:
    found = trials.of([effect for effect in final.effects if effect.key not in doubted])
    assert found is not None
    return found
