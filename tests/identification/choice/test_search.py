"""The search: several causes give way to the one that they imitate, and two causes stay two."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from wbc.effects import (
    EFFECTS,
    CoulombFriction,
    JointCompliance,
    LoadFriction,
    PayloadMass,
    SupplySag,
    TorqueConstant,
    TransmissionEfficiency,
    load_robot,
)
from wbc.identification.choice.evidence import Hypothesis
from wbc.identification.choice.proposals import Proposer
from wbc.identification.choice.search import Search
from wbc.identification.choice.trials import Trials
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


def test_exchanges_beside_a_link_that_swings_are_screened_without_a_fit() -> None:
    hidden = [JointCompliance("knee", 300.0, 0.5), CoulombFriction("hip", 0.5)]
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, hidden[1:], duration=3.0))
    trials = Trials(problem)
    h = trials.of(hidden)
    assert h is not None
    known = len(trials.known)
    Proposer(trials, AT_ONCE).instead(h, hidden[1], 3)
    assert len(trials.known) == known
