"""The search: several causes give way to the one that they imitate, and two causes stay two."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from wbc.effects import (
    EFFECTS,
    CoulombFriction,
    LoadFriction,
    PayloadMass,
    QuadraticDrag,
    RotorInertia,
    SupplySag,
    TorqueConstant,
    TransmissionEfficiency,
    ViscousFriction,
    load_robot,
)
from wbc.identification.choice import moves, proposals
from wbc.identification.choice.linear_screen import screen
from wbc.identification.choice.proposals import Proposer
from wbc.identification.choice.search import Search
from wbc.identification.choice.weighing.drop_screen import exchanged, losses
from wbc.identification.choice.weighing.evidence import log_densities, weigh
from wbc.identification.choice.weighing.hypothesis import Hypothesis, without
from wbc.identification.choice.weighing.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect
from wbc.sim.excitation import record_with

AT_ONCE = tuple(kind for kind in EFFECTS.values() if not deflects(kind))

LEG = load_robot("planar_leg_fixed").lossless()


def _climbed(hidden: Sequence[Effect], start: Sequence[Effect] = ()) -> tuple[Search, Hypothesis]:
    """Return the search on logs of what is hidden, from a start, and where it ends."""
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, list(hidden), duration=4.0))
    trials = Trials(problem)
    search = Search(Proposer(trials, AT_ONCE))
    begun = trials.of(tuple(start))
    assert begun is not None
    return search, search.climb(begun)


@pytest.mark.parametrize("beside", [[], [CoulombFriction("hip", 0.5)]], ids=["alone", "beside"])
def test_a_lossy_gear_is_no_load_friction_with_a_wrong_torque_constant(
    beside: list[Effect],
) -> None:
    hidden = [TransmissionEfficiency("knee", 0.8, 0.9), *beside]
    _, end = _climbed(hidden)
    assert set(end.keys) == {e.key for e in hidden}


def test_derivatives_say_what_a_hypothesis_loses_without_a_cause() -> None:
    hidden = [CoulombFriction("hip", 0.3), ViscousFriction("knee", 0.2)]
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=4.0))
    trials = Trials(problem)
    whole = trials.of((*hidden, CoulombFriction("knee", 0.1), PayloadMass("foot", 0.05)))
    assert whole is not None
    drops = [(effect,) for effect in whole.effects]
    expected = losses(problem, trials.fit(whole), whole, drops)
    for own, (loss, gain) in zip(drops, expected, strict=True):
        less = trials.of(without(whole.effects, *own))
        assert less is not None
        here, there = log_densities(problem, [whole, less]).sum(axis=1)
        assert loss == pytest.approx(here - there, rel=0.3, abs=3.0)
        assert gain == pytest.approx(less.prior - whole.prior, abs=0.5)
    assert [loss < gain for loss, gain in expected] == [False, False, True, True]


@pytest.mark.parametrize(
    "hidden",
    [
        [CoulombFriction("hip", 0.5), PayloadMass("foot", 0.3)],
        [LoadFriction("hip", 0.1), SupplySag("robot", 2e-3), TorqueConstant("knee", 0.8)],
    ],
    ids=["two", "three"],
)
def test_causes_that_no_other_explains_stay(hidden: list[Effect]) -> None:
    _, end = _climbed(hidden, hidden)
    assert set(end.keys) == {e.key for e in hidden}


def test_what_explains_something_else_is_not_tried_in_the_place_of_a_cause(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It was tried as a cause more: on twelve joints such trials were most of the cost."""
    monkeypatch.setattr(proposals, "_BEYOND_FITS", np.inf)  # what is far behind is tried, too
    hidden = [ViscousFriction("hip", 0.3), CoulombFriction("knee", 0.6)]
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=4.0))
    proposer = Proposer(Trials(problem), AT_ONCE)
    begun = proposer.trials.of((ViscousFriction("hip", 0.2),))
    assert begun is not None
    tried = [h.keys for h in moves.swaps(proposer, begun)]
    assert any(("coulomb_friction", "hip") in keys for keys in tried)  # both rub at the hip
    assert not [keys for keys in tried if all(where == "knee" for _, where in keys)]


def test_a_wrong_start_is_left() -> None:
    hidden = CoulombFriction("hip", 0.5)
    search, end = _climbed([hidden], [TorqueConstant("knee", 1.2)])
    assert end.keys == (hidden.key,)
    assert search.path[-1] is end


def test_what_machines_usually_have_is_found_in_one_move() -> None:
    """Friction and rotor inertia of all joints together; what is not there is dropped next."""
    hidden = [
        CoulombFriction("hip", 0.4),
        CoulombFriction("knee", 0.3),
        ViscousFriction("hip", 0.2),
        RotorInertia("knee", 0.02),
    ]
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=4.0))
    search = Search(Proposer(Trials(problem), AT_ONCE))
    found = search.climb(search.proposer.trials.nothing)
    assert {*found.keys} == {effect.key for effect in hidden}
    assert len(search.path[0].effects) == 6
    assert len(search.path) <= 3
    assert moves.usual(search.proposer, found) == []


@pytest.mark.parametrize(
    ("constant", "level"), [(0.85, 0.4), (1.1, 0.6)], ids=["weak drive", "strong drive"]
)
def test_a_wrong_torque_constant_with_friction_is_no_lossy_gear(
    constant: float, level: float
) -> None:
    """A recorded arm was said to have a backward efficiency of 0.63 with 0.97."""
    hidden = [TorqueConstant("knee", constant), CoulombFriction("knee", level)]
    _, end = _climbed(hidden)
    assert set(end.keys) == {effect.key for effect in hidden}


def test_derivatives_say_what_an_exchange_changes() -> None:
    hidden = [CoulombFriction("hip", 0.5), ViscousFriction("knee", 0.3)]
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=4.0))
    trials = Trials(problem)
    h = trials.of(tuple(hidden))
    assert h is not None
    fit = trials.fit(h)
    _, regressors = screen(problem, fit, [QuadraticDrag, RotorInertia, CoulombFriction], ())
    for regressor in regressors:
        own = [effect for effect in h.effects if effect.key != regressor.key][-1]
        if regressor.key in h.keys:
            continue
        start = regressor.effect.at(
            regressor.where, {p.name: 0.01 for p in regressor.effect.parameters}
        )
        other = trials.of((*without(h.effects, own), start))
        assert other is not None
        said = exchanged(problem, fit, h, [own], [regressor.columns], other.effects)
        here, there = weigh(problem, [h, other])
        assert said == pytest.approx(there - here + sum(other.implausible), rel=0.3, abs=5.0)
