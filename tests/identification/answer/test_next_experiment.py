"""What is said of rivals that an experiment separates, and of those that none does."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import EFFECTS, CoulombFriction, LoadFriction, PositionOffset
from wbc.identification.answer.diagnosis.diagnosis import Alternative, Finding
from wbc.identification.answer.diagnosis.verdict import next_experiment
from wbc.identification.answer.remainder.remainder import Remainder
from wbc.identification.choice.weighing.certainty import Support
from wbc.identification.records.noise.noise_floor import NoiseFloor
from wbc.robot import Effect

FLOOR = NoiseFloor(np.eye(2), np.eye(2), ())
REPEATED = NoiseFloor(np.eye(2), np.eye(2), ((0, 1),))


def _said(effect: Effect, *alternatives: str) -> str:
    rivals = tuple(Alternative(*name.split(" at ")) for name in alternatives)
    finding = Finding(effect, {}, Support(0.5, 1.0, 0.0, 0.0, explained=True), rivals)
    return next_experiment("ambiguous", [finding], (), FLOOR, EFFECTS)


@pytest.mark.parametrize(
    ("effect", "rival", "words"),
    [
        (PositionOffset("knee", 0.1), "center_of_mass", "spirit level"),
        (PositionOffset("hip", 0.1), "gravity_direction", "tilted"),
        (LoadFriction("knee", 0.1), "transmission_efficiency", "no run tells them apart"),
    ],
)
def test_exact_equals_are_called_so_in_either_order(effect: Effect, rival: str, words: str) -> None:
    assert words in _said(effect, f"{rival} at {effect.where}")
    other = EFFECTS[rival].at("x")
    assert words in _said(other, f"{effect.name} at x")
    assert EFFECTS[rival].experiment in _said(effect, f"{rival} at {effect.where}")


def test_rivals_that_an_experiment_separates_are_not() -> None:
    said = _said(CoulombFriction("hip", 0.3), "viscous_friction at hip", "coulomb_friction at knee")
    assert said.startswith("To tell Coulomb friction from viscous friction")
    assert "no run" not in said.lower()


def test_every_inseparable_effect_exists() -> None:
    for kind in EFFECTS.values():
        assert set(kind.inseparable) <= set(EFFECTS) - {kind.name}


def left(clue: str, elsewhere: str = "", memory: bool = False) -> Remainder:
    return Remainder("knee", 1.0, "N m", 20.0, ((clue, 0.5),), elsewhere, 1.0, memory)


@pytest.mark.parametrize(
    ("remainder", "words"),
    [
        (left("acceleration"), "inertia of a link or rotor"),
        (left("load"), "centre of mass"),
        (left("speed", memory=True), "strokes of several sizes"),
        (left("time"), "for several minutes"),
        (left("speed of hip", elsewhere="hip"), "Move hip alone while knee holds still"),
    ],
    ids=["inertia", "mass", "memory", "time", "elsewhere"],
)
def test_what_is_left_says_what_to_record(remainder: Remainder, words: str) -> None:
    for verdict in ("unknown", "partial"):
        assert words in next_experiment(verdict, [], [remainder], REPEATED, EFFECTS)


def test_a_floor_that_is_only_a_bound_asks_for_a_repeat() -> None:
    one = left("speed")
    assert "Repeat one run exactly" in next_experiment("unknown", [], [one], FLOOR, EFFECTS)
    assert "Repeat" not in next_experiment("unknown", [], [one], REPEATED, EFFECTS)
