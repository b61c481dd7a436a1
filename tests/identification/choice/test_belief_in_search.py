"""The search beside what is not believed, and what it offers where drives are set aside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wbc.arrays import FloatArray
from wbc.effects import (
    EFFECTS,
    CoulombFriction,
    LinkInertia,
    LinkInertias,
    QuadraticDrag,
    TransmissionEfficiency,
    ViscousFriction,
    load_robot,
)
from wbc.identification.answer.attainable import attainable
from wbc.identification.answer.diagnosis import believed as believed_module
from wbc.identification.answer.diagnosis.believed import believed
from wbc.identification.choice import search as search_module
from wbc.identification.choice.find_causes import SearchResult
from wbc.identification.choice.proposals import Proposer
from wbc.identification.choice.search import Search
from wbc.identification.choice.weighing.certainty import (
    BELIEVED,
    Support,
    beliefs,
    doubted_names,
    least_believed,
    support_of,
)
from wbc.identification.choice.weighing.evidence import weigh
from wbc.identification.choice.weighing.hypothesis import Hypothesis, Key
from wbc.identification.choice.weighing.odds import Odds, odds_of
from wbc.identification.choice.weighing.trials import Trials
from wbc.identification.model.derivatives import derivatives, evaluate, with_changes
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import condensed_residual
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect
from wbc.sim.excitation import record_with

AT_ONCE = tuple(kind for kind in EFFECTS.values() if not deflects(kind))

LEG = load_robot("planar_leg_fixed").lossless()


def _problem(*hidden: Effect) -> EstimationProblem:
    return EstimationProblem.from_logs(LEG, record_with(LEG, list(hidden), duration=4.0))


def test_causes_that_only_a_drive_set_aside_feels_are_not_offered() -> None:
    """On a recorded arm half of all numbers fitted were those of drives that report nothing."""
    problem = _problem(CoulombFriction("hip", 0.5), CoulombFriction("knee", 0.5))
    knee = LEG.transmission.index("knee")
    problem = replace(problem, floor=replace(problem.floor, aside=(knee,)))
    proposer = Proposer(Trials(problem), AT_ONCE)
    offered = {e.key for offer in proposer.beside(proposer.trials.nothing, 20) for e in offer}
    assert ("coulomb_friction", "hip") in offered
    assert ("coulomb_friction", "knee") not in offered


def test_derivatives_by_link_inertias_beside_a_lossy_gear_are_those_of_the_residual() -> None:
    problem = _problem(TransmissionEfficiency("knee", 0.8, 0.9))
    null = LinkInertias.null_values(LEG, "robot")
    drawn = LinkInertias.at("robot", {name: 0.05 for name in null})
    effects = (TransmissionEfficiency("knee", 0.8, 0.9), CoulombFriction("hip", 0.3), drawn)
    at = evaluate(LEG, effects, problem.records, problem.whitening)
    slots = [(2, parameter) for parameter in drawn.parameters]
    columns = derivatives(LEG, at, slots, problem.records, problem.whitening)
    for row, (k, parameter) in enumerate(slots):
        moved = with_changes(effects, {(k, parameter.name): 1e-4 * parameter.scale})
        after = condensed_residual(LEG.with_effects(*moved), problem.records) @ problem.whitening
        expected = (after - at.residual) / 1e-4
        size = max(float(np.max(np.abs(columns))), 1e-12)
        assert np.max(np.abs(columns[:, :, row] - expected)) < 2e-3 * size


@pytest.mark.parametrize(
    "tried",
    [
        (ViscousFriction("hip", 0.2), ViscousFriction("knee", 0.1)),
        (CoulombFriction("hip", 0.3), EFFECTS["torque_constant"].at("knee", {})),
    ],
    ids=["friction", "drive"],
)
def test_derivatives_doubt_the_names_that_fits_doubt(tried: tuple[Effect, ...]) -> None:
    problem = _problem(
        TransmissionEfficiency("hip", 0.7, 0.7), CoulombFriction("knee", 1.0), *tried[:1]
    )
    trials = Trials(problem)
    h = trials.of(tried)
    assert h is not None
    level = attainable(problem, trials.fit(h))
    support = support_of(trials, h, odds_of(trials, [h], h), level.excess, explained=False)
    expected = {
        name
        for name in {e.name for e in h.effects}
        if all(s.probability < BELIEVED for key, s in support.items() if key[0] == name)
    }
    assert {*doubted_names(trials, h)} == expected


def test_an_effect_at_every_joint_may_imitate_what_sits_in_every_joint() -> None:
    """Rotor inertias at five of six joints imitated an unknown memory of friction: 0.996 each."""
    five = 4 * 5 / 6

    def probability(expected: float, remainder: float) -> float:
        support = Support(1.0, 1.0, remainder, five, explained=False, expected=expected)
        return support.probability

    assert probability(expected=1.0, remainder=1.1) < 0.95  # a rotor's inertia
    assert probability(expected=2.0, remainder=1.1) > 0.95  # friction, which most robots have


def test_an_effect_at_all_joints_that_are_judged_is_at_all_joints() -> None:
    problem = _problem(CoulombFriction("hip", 0.5))
    knee = LEG.transmission.index("knee")
    assert problem.judged_joints == ("hip", "knee")
    aside = replace(problem, floor=replace(problem.floor, aside=(knee,)))
    assert aside.judged_joints == ("hip",)


def test_nothing_is_added_beside_a_wrong_drawing_that_is_not_believed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a recorded arm link inertias that the answer drops cost more than all else together."""
    drawn = LinkInertia.at("shin", dict.fromkeys(LinkInertia.null_values(LEG, "shin"), 0.1))
    problem = _problem(drawn, CoulombFriction("hip", 0.05), ViscousFriction("knee", 0.05))
    monkeypatch.setattr(search_module, "doubted_names", lambda trials, h: _names(h))
    told: list[str] = []
    search = Search(Proposer(Trials(problem), AT_ONCE), told.append)
    search.climb(search.proposer.trials.nothing)
    doubtful = told[-1].removeprefix("nothing more is tried beside what is not believed: ")
    assert doubtful in {"link_inertia", "link_inertias"}  # of all the names that are doubted
    assert len([h for h in search.path if doubtful in _names(h)]) == 2


def test_what_is_believed_without_a_doubtful_cause_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a recorded quadruped a delay took belief from a drawing, and both were removed."""
    drag, friction = QuadraticDrag("knee", 0.05), CoulombFriction("hip", 0.3)
    trials = Trials(_problem(friction))
    both = trials.of((friction, drag))
    assert both is not None

    def chances(trials: Trials, h: Hypothesis) -> dict[Key, float]:
        return {drag.key: 0.4, friction.key: 0.6} if drag.key in h.keys else {friction.key: 0.9}

    monkeypatch.setattr(believed_module, "beliefs", chances)
    answer = believed(SearchResult(trials, (trials.nothing, both), both))
    assert answer.hypothesis.keys == (friction.key,)


def test_the_end_of_a_search_stays_where_more_evidence_is_not_believed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a recorded double pendulum a rotor inertia was doubted beside a drawing, and removed."""
    friction, viscous = CoulombFriction("hip", 0.5), ViscousFriction("knee", 0.3)
    drag = QuadraticDrag("knee", 0.2)
    trials = Trials(_problem(friction, viscous, drag))
    end, every = trials.of((friction, viscous)), trials.of((friction, viscous, drag))
    assert end is not None
    assert every is not None
    assert np.argmax(weigh(trials.problem, [end, every])) == 1

    def support(
        trials: Trials, h: Hypothesis, odds: Odds, excess: FloatArray, explained: bool
    ) -> dict[Key, Support]:
        beside = 0.6 if drag.key in h.keys else 0.9
        chances = {friction.key: 0.99, viscous.key: beside, drag.key: 0.65}
        return {key: Support(chances[key], chances[key], 0.0, 0.0, True) for key in h.keys}

    monkeypatch.setattr(believed_module, "support_of", support)
    answer = believed(SearchResult(trials, (trials.nothing, every, end), end))
    assert answer.hypothesis is end
    assert answer.doubted is None


def test_derivatives_believe_each_cause_as_far_as_fits_do() -> None:
    problem = _problem(TransmissionEfficiency("hip", 0.6, 0.6), CoulombFriction("knee", 1.0))
    trials = Trials(problem)
    h = trials.of((ViscousFriction("hip", 0.2), QuadraticDrag("knee", 0.05)))
    assert h is not None
    chances = beliefs(trials, h)
    level = attainable(problem, trials.fit(h))
    support = support_of(trials, h, odds_of(trials, [h], h), level.excess, explained=False)
    expected = {key: s.probability for key, s in support.items()}
    assert chances == pytest.approx(expected, abs=0.1)
    assert least_believed(chances) == min(expected, key=expected.__getitem__)


def _names(h: Hypothesis) -> set[str]:
    return {effect.name for effect in h.effects}
