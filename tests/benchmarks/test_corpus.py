"""The corpus itself: what a case follows from, what may rightly be said, how it is judged."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.corpus.case import Case
from benchmarks.corpus.draw import SEED, draw_case
from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.families import draw_machine
from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.record import record_cases
from benchmarks.corpus.scorecard import score
from benchmarks.corpus.sensors import Sensors
from benchmarks.corpus.trial import logs_of, robot_of, try_cases
from benchmarks.corpus.truth import truth_of
from benchmarks.corpus.verdicts import first_right, invented, judge_result
from wbc.effects import (
    ActuationDelay,
    CoulombFriction,
    SupplySag,
    ViscousFriction,
    effect_class,
)
from wbc.identification import diagnose
from wbc.identification.model.estimation_problem import EstimationProblem

SENSORS = Sensors(rate=250.0, position=1e-5, bits=18, velocity=1e-3, torque=0.002, force=0.2)
# A tilted arm; a body in flight with a torque offset, friction and an offset that a loss of the
# backward power alone hides.
QUICK = (24, 430)


def case_of(*flaws: Flaw, kinds: tuple[str, ...] = ("multisine",), family: str = "arm2") -> Case:
    machine = draw_machine(np.random.default_rng(4), family)
    noise = 0.005 * np.ones(len(machine.driven))
    runs = tuple(Excitation(kind, 30 + k, 4.0, k) for k, kind in enumerate(kinds))
    return Case(0, machine, flaws, runs, "fair", SENSORS, noise)


def test_a_case_follows_from_its_number() -> None:
    one, same = draw_case(6), draw_case(6)
    assert one.flaws == same.flaws
    assert one.excitations == same.excitations
    first, second = (record_cases([(c, c.excitations)])[0] for c in (one, same))
    for table, other in zip(first, second, strict=True):
        assert all(np.array_equal(table[name], other[name]) for name in table)


def test_a_stepped_plant_is_late_by_what_its_truth_says() -> None:
    """Seed 20, case 172: 0.651 ms were drawn, and its plant with steps of 0.25 ms had 0.75."""
    delays = [flaw.values["delay"] for flaw in draw_case(172).flaws]
    assert delays == pytest.approx([0.75e-3, 0.75e-3])


def test_a_wrong_zero_of_the_first_joint_is_a_tilted_gravity() -> None:
    for joint, tilted in (("j1", True), ("j2", False)):
        cause = truth_of(case_of(Flaw("position_offset", joint, {"offset": 0.05}))).causes[0]
        assert ("gravity_direction" in cause.stand_ins) == tilted


def test_a_shifted_center_of_mass_is_a_wrong_zero_with_more_parameters() -> None:
    """In case 331 neither direction of the shift does alone."""
    cause = truth_of(draw_case(331)).causes[0]
    assert (cause.effect, cause.stand_ins) == ("position_offset", ())
    assert cause.equals == ("center_of_mass",)
    cause = truth_of(case_of(Flaw("payload_mass", "tip", {"mass": 0.2}))).causes[0]
    # A mass on a link is one of the ways in which its drawing can be wrong.
    assert (cause.stand_ins, cause.equals) == ((), ("link_inertia",))


def test_what_is_too_small_need_not_be_named() -> None:
    large, small = (
        truth_of(case_of(Flaw("viscous_friction", "j1", {"coefficient": c}))).causes[0]
        for c in (0.2, 1e-5)
    )
    assert large.felt
    assert not small.felt
    assert large.size == pytest.approx(2e4 * small.size, rel=1e-3)


def answer(verdict: str, *found: tuple[str, str, tuple[str, ...]]) -> dict[str, Any]:
    causes = [
        {"effect": "load_friction", "where": ["j1"], "size": 8.0, "felt": True,
         "stand_ins": ["transmission_efficiency"]}
    ]  # fmt: skip
    entries = [
        {"effect": e, "where": w, "alternatives": list(a), "parameters": {"coefficient": c}}
        for (e, w, a), c in zip(found, ([0.2, 0.1, 0.3], [0.2, 0.1, 0.3]), strict=False)
    ]
    return {"number": 0, "verdict": verdict, "found": entries, "causes": causes, "merged": [],
            "unlisted": False, "unexplained": 0.0,
            "flaws": [["load_friction", "j1", {"coefficient": 0.25}]]}  # fmt: skip


def test_an_answer_is_held_against_its_truth() -> None:
    right = answer("named", ("load_friction", "j1", ()))
    elsewhere = answer("named", ("load_friction", "j2", ()))
    equal = answer("named", ("transmission_efficiency", "j1", ()))
    rival = answer("ambiguous", ("viscous_friction", "j1", ("load_friction",)))
    wrong = answer("named", ("viscous_friction", "j1", ()))
    extra = answer("named", ("load_friction", "j1", ()), ("viscous_friction", "j1", ()))
    every = (right, elsewhere, equal, rival, wrong, extra)
    assert [judge_result(r).covered for r in every] == [True, True, True, True, False, True]
    assert [judge_result(r).placed for r in every] == [True, False, False, False, False, False]
    assert [judge_result(r).names for r in every] == [1, 1, 1, 2, 1, 2]
    assert [first_right(r) for r in (right, equal, wrong)] == [True, True, False]
    assert [invented(r) for r in every] == [False, False, False, False, True, True]
    figures = {figure.name: figure for figure in score([right, wrong])}
    assert figures["truth in the named set"][1:3] == (50.0, 2)
    assert figures["90 % intervals cover"][1:3] == (100.0, 1)


@pytest.mark.parametrize("number", [4, 32, 93, 303])
def test_what_is_hidden_in_a_short_log_leaves_noise(number: int) -> None:
    """Logs of 3 to 6 s; in the last two a body flies, of whose motion only the pose is known."""
    case = draw_case(number, seed=21)
    logs = logs_of(record_cases([(case, case.excitations)])[0])
    problem = EstimationProblem.from_logs(robot_of(case), logs)
    truth = [effect_class(flaw.effect)(flaw.where, **flaw.values) for flaw in case.flaws]
    fit = problem.fit(truth)
    held = fit.held_out_residual()
    assert np.mean(held**2) < 1.6


def test_causes_that_hide_one_another_are_found(tmp_path: Path) -> None:
    """Seed 22, case 401: beside damping of the first joint its delay of 1 ms looks negative."""
    result = try_cases([401], tmp_path, 22)[0]
    assert judge_result(result).placed
    assert result["after"] < 1.0


def test_causes_at_different_places_that_hide_one_another_are_found(tmp_path: Path) -> None:
    """A wrong link, a supply that sags: each alone made the evidence fall, and 18 floors stayed."""
    (result,) = try_cases([18], tmp_path, seed=97)
    found = {(entry["effect"], entry["where"]) for entry in result["found"]}
    assert found >= {("link_inertia", "l1"), ("supply_sag", "robot")}
    assert result["after"] < 1.2


def test_a_few_cases_are_told_and_kept(tmp_path: Path) -> None:
    results = try_cases(QUICK, tmp_path, SEED)
    assert [judge_result(result).good for result in results] == [True] * len(QUICK)
    kept = [json.loads((tmp_path / f"{n:04d}.json").read_text()) for n in QUICK]
    assert kept == json.loads(json.dumps(results))


def test_laws_of_position_that_are_one_cable_together_are_not_certain(tmp_path: Path) -> None:
    """A cable that is slack in places was a spring, a wrong zero and a ripple, 0.999 each."""
    (result,) = try_cases([80], tmp_path, seed=31337)
    assert [name for name, *_ in result["flaws"]] == ["one_sided_cable"]
    assert len(result["found"]) > 2
    assert max(entry["probability"] for entry in result["found"]) < 0.95


def test_what_a_supply_lacks_is_no_delay_of_all_drives() -> None:
    """It was taken out as a delay of all torques, and delays at all joints took that back."""
    sag, kinds = Flaw("supply_sag", "robot", {"coefficient": 5e-5}), ("multisine", "fast")
    case = case_of(sag, kinds=kinds, family="arm4")
    logs = logs_of(record_cases([(case, case.excitations)])[0])
    offered = [SupplySag, ActuationDelay, CoulombFriction, ViscousFriction]
    found = diagnose(robot_of(case), logs, offered)
    assert {finding.effect.name for finding in found.findings} == {"supply_sag"}
    assert found.verdict == "named"
