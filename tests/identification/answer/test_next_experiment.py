"""What is said of rivals that an experiment separates, and of those that none does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wbc.effects import EFFECTS, CoulombFriction, LoadFriction, PositionOffset
from wbc.identification.answer.diagnose import next_experiment
from wbc.identification.answer.diagnosis import Alternative, Finding, Verdict
from wbc.identification.answer.remainder import Remainder
from wbc.identification.choice.certainty import Support
from wbc.identification.records.noise import NoiseFloor
from wbc.robot import Effect

FLOOR = NoiseFloor(np.eye(2), np.eye(2), ())
REPEATED = NoiseFloor(np.eye(2), np.eye(2), ((0, 1),))


def _finding(effect: Effect, *alternatives: str) -> Finding:
    rivals = tuple(Alternative(*name.split(" at ")) for name in alternatives)
    return Finding(effect, {}, Support(0.5, 1.0, 0.0, 0.0, explained=True), rivals)


def _said(effect: Effect, *alternatives: str) -> str:
    return next_experiment("ambiguous", [_finding(effect, *alternatives)], (), FLOOR, EFFECTS)


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
    motion = EFFECTS[rival].experiment.partition(":")[0][1:]
    assert motion in _said(effect, f"{rival} at {effect.where}")


def test_many_rivals_ask_for_few_motions() -> None:
    said = _said(CoulombFriction("hip", 0.3), *(f"{name} at hip" for name in sorted(EFFECTS)))
    motions = said.partition("At hip: ")[2].partition(". ")[0]
    assert motions.startswith("move the joint slowly back and forth through the same positions;")
    assert motions.count("; ") == 2


def test_every_inseparable_effect_exists() -> None:
    for kind in EFFECTS.values():
        assert set(kind.search.inseparable) <= set(EFFECTS) - {kind.name}


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


@pytest.mark.parametrize("verdict", ["unknown", "partial"])
def test_drives_that_report_only_noise_come_first(verdict: Verdict) -> None:
    said = next_experiment(verdict, [], [left("speed")], REPEATED, EFFECTS, ("hip", "knee"))
    assert said.startswith("The drives of hip and knee report only noise")
    assert "constant speeds" not in said  # nothing is known of the knee
    both = next_experiment(verdict, [], [left("speed")], REPEATED, EFFECTS, ("hip",))
    assert both.startswith("The drive of hip reports only noise, so these logs say nothing about ")
    assert "Turn knee at several constant speeds" in both


def test_nobody_is_asked_to_hold_a_joint_still_that_no_motor_moves() -> None:
    left = Remainder("shoulder", 1.0, "N m", 20.0, (("load", 0.5),), "elbow", 1.0, True, False)
    assert left.experiment.startswith("move elbow alone: what is left at shoulder")
    assert not replace(left, elsewhere="").experiment


def test_a_floor_that_cannot_be_is_not_counted_in() -> None:
    left = Remainder("knee", 1.0, "N m", 58383.0, (), "", 1.0, False)
    assert "more than 100 times the noise floor" in left.text
    assert "58383" not in left.text
