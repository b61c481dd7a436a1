"""What is said of rivals that an experiment separates, and of those that none does."""

from __future__ import annotations

import pytest

from wbc.effects import EFFECTS, CoulombFriction, LoadFriction, PositionOffset
from wbc.identification.answer.diagnosis import Finding
from wbc.identification.answer.verdict import next_experiment
from wbc.robot import Effect


def _said(effect: Effect, *alternatives: str) -> str:
    return next_experiment("ambiguous", [Finding(effect, {}, alternatives)], nothing_moves=False)


@pytest.mark.parametrize(
    ("effect", "rival", "words"),
    [
        (PositionOffset("knee", 0.1), "center_of_mass", "spirit level"),
        (PositionOffset("hip", 0.1), "gravity_direction", "tilted"),
        (LoadFriction("knee", 0.1), "transmission_efficiency", "no run tells them apart"),
    ],
)
def test_exact_equals_are_called_so_in_either_order(effect: Effect, rival: str, words: str) -> None:
    assert words in _said(effect, rival)
    other = EFFECTS[rival].at("x")
    assert words in _said(other, effect.name)
    assert EFFECTS[rival].experiment in _said(effect, rival)


def test_rivals_that_an_experiment_separates_are_not() -> None:
    said = _said(CoulombFriction("hip", 0.3), "viscous_friction", "coulomb_friction at knee")
    assert said.startswith("To tell coulomb_friction from viscous_friction")
    assert "no run" not in said.lower()


def test_every_inseparable_effect_exists() -> None:
    for kind in EFFECTS.values():
        assert set(kind.inseparable) <= set(EFFECTS) - {kind.name}
