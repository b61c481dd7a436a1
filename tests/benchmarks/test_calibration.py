"""What benchmarks conclude: probabilities, wrong columns, and the classic fit."""

from typing import Any

import numpy as np
import pytest

from benchmarks.classic_fit import ratio_error
from benchmarks.corpus.calibration import reached, reliability
from benchmarks.corpus.draw import COUNT, LISTED, draw_case
from benchmarks.corpus.record import record_cases
from benchmarks.corpus.trial import logs_of, robot_of
from benchmarks.corpus.truth import truth_of
from benchmarks.corpus.unlisted import NAMES
from benchmarks.corpus.verdicts import judge_result
from wbc.identification.readings import find_suspicions


def result(found: str, probability: float, verdict: str = "named", size: float = 8.0) -> Any:
    cause = {"effect": "coulomb_friction", "where": ["j1"], "size": size, "felt": True,
             "stand_ins": []}  # fmt: skip
    entry = {"effect": found, "where": "j1", "alternatives": [], "parameters": {},
             "probability": probability}  # fmt: skip
    return {"found": [entry], "causes": [cause], "merged": [], "unlisted": False, "flaws": [],
            "verdict": verdict, "unexplained": 0.0}  # fmt: skip


def test_the_share_that_is_true_is_counted_by_what_was_stated() -> None:
    right = [result("coulomb_friction", 0.99) for _ in range(19)]
    low, high = reliability([*right, result("torque_offset", 0.97), result("torque_offset", 0.6)])
    assert (low.true, low.count) == (0.0, 1)
    assert (high.true, high.count) == (0.95, 20)
    assert high.low < 0.95 < high.high
    assert high.stated == pytest.approx((19 * 0.99 + 0.97) / 20)


def test_large_causes_must_reach_certainty() -> None:
    results = [result("coulomb_friction", probability) for probability in (0.99, 0.9)]
    results += [result("torque_offset", 0.99), result("coulomb_friction", 0.99, size=2.0)]
    assert reached(results) == (1, 3)


def test_cases_beyond_the_count_hold_a_cause_of_the_list_beside_one_outside() -> None:
    case = draw_case(COUNT + 3)
    listed, outside = case.causes
    assert listed in LISTED
    assert outside in NAMES
    truth = truth_of(case)
    assert [cause.effect for cause in truth.causes] == [listed, outside]
    assert truth.unexplained > 0.0


def test_a_certain_cause_that_is_false_is_wrong_beside_one_outside() -> None:
    mixed = result("coulomb_friction", 0.99, "partial")
    mixed["unlisted"], mixed["unexplained"] = True, 9.0
    mixed["causes"].append({"effect": "bouc_wen", "where": ["j2"], "size": 9.0, "felt": True,
                            "stand_ins": []})  # fmt: skip
    assert judge_result(mixed).kind == "mixed"
    assert judge_result(mixed).good
    mixed["found"][0]["effect"] = "viscous_friction"
    assert not judge_result(mixed).good
    mixed["found"][0]["probability"] = 0.8
    assert judge_result(mixed).good


# One joint moves, under a payload; a knee pushes with another joint's speed, more than it carries;
# a body in free fall moves its joints little. Each was refused for a mistake that nobody had made.
@pytest.mark.parametrize("number", [122, 137, 532])
def test_strange_physics_is_no_wrong_column(number: int) -> None:
    case = draw_case(number, 23)
    (tables,) = record_cases([(case, case.excitations)])
    found = find_suspicions(logs_of(tables), robot_of(case))
    assert [f.text for own in found for f in own if f.severity == "error"] == []


def test_the_error_of_a_ratio_is_that_of_repeated_logs() -> None:
    """Beside the spread over logs drawn anew: one output shares its rows' noise, one does not."""
    rng, blocks = np.random.default_rng(1), np.repeat(np.arange(60), 10)

    def log() -> tuple[np.ndarray, np.ndarray]:
        # Rows of a block leave the same: 60 independent values, not 600.
        one, other, own = (np.repeat(rng.normal(size=(60, 2)), 10, axis=0) for _ in range(3))
        return one, np.column_stack([one[:, 0] + 0.1 * own[:, 0], other[:, 1]])

    ratios = []
    for _ in range(400):
        left, other = log()
        ratios.append(np.sqrt(np.mean(left**2, axis=0) / np.mean(other**2, axis=0)))
    told = np.mean([ratio_error(*log(), blocks) for _ in range(40)], axis=0)
    assert told == pytest.approx(np.std(ratios, axis=0), rel=0.15)
    assert told[0] < told[1] / 5
