"""Repeats, copies and holes among logs."""

from dataclasses import replace

import numpy as np
import pytest

from tests.moved import without_rows
from tests.outside import outside
from wbc.effects import load_robot
from wbc.errors import LogError
from wbc.identification.readings import check_log, find_repeats
from wbc.measurement import Log, LogSource, cut_at_gaps, load_logs
from wbc.measurement.checks import find_duplicates
from wbc.measurement.filters import residual_noise


def _run(seed: int, *, phase: float = 0.0, offset: float = 0.0) -> Log:
    t, noise = np.arange(1500) * 0.002, np.random.default_rng(seed).normal(size=(3, 1500))
    position = np.sin(3.0 * t + phase) + 0.5 * np.sin(7.0 * t)
    columns = {"hip.position": position + 2e-4 * noise[0], "knee.position": 0.2 + 2e-4 * noise[1]}
    columns["hip.motor_torque"] = 4.0 * position + 0.05 * noise[2]
    return Log(t + offset, columns)


def test_repeats_are_found_and_copies_and_other_runs_are_not() -> None:
    logs = [_run(0), _run(1, phase=1.0), _run(2, offset=11.0), _run(3, phase=0.01), _run(0)]
    assert find_repeats(logs) == ((0, 2, 3),)
    assert find_duplicates(logs) == ((0, 4),)
    assert find_repeats([logs[0], logs[4]]) == ()
    assert find_repeats([logs[0], logs[2][:1000]]) == ()


@pytest.mark.parametrize("case", ["case00", "case02", "case09", "case10"])
def test_the_practice_leg_repeats_a_by_b_and_shows_its_stated_noise(case: str) -> None:
    logs = load_logs([outside(f"practice_leg/{case}{letter}.csv") for letter in "abcd"])
    assert find_repeats(logs) == ((0, 1),)
    # README: position 2e-5 rad and 18-bit quantisation, velocity 3e-3 rad/s, rotor torque 2e-3 N m.
    stated = {"position": (2.1e-5, 0.1), "velocity": (3e-3, 0.05), "rotor_torque": (2e-3, 0.1)}
    for name in (f"{joint}.{quantity}" for joint in ("hip", "knee") for quantity in stated):
        level, share = stated[name.partition(".")[2]]
        assert residual_noise(logs[0].time, logs[0].column(name)) == pytest.approx(level, rel=share)


def test_a_hole_is_no_wrap_of_the_encoder_that_moves_on_meanwhile(swing: Log) -> None:
    turn = swing.with_columns({"hip.position": 0.5 * np.sin(2.0 * swing.time)})
    findings = check_log(without_rows(turn, (1200, 1500))).findings
    assert [finding.kind for finding in findings] == ["gap"]
    wrapped = turn.column("hip.position") + 2.0 * np.pi * (swing.time > 1.0)
    log = without_rows(turn.with_columns({"hip.position": wrapped}), (1200, 1500))
    assert {finding.kind for finding in check_log(log).findings} == {"gap", "wrap"}


def test_a_log_is_cut_where_samples_are_missing(swing: Log) -> None:
    named = replace(swing, source=LogSource(path="run.csv"))
    pieces, (warning,) = cut_at_gaps([swing, without_rows(named, (800, 1000))])
    assert pieces[0] is swing
    assert [piece.source.part for piece in pieces[1:]] == ["0.000..1.598 s", "2.000..3.998 s"]
    for piece, rows in zip(pieces[1:], (slice(0, 800), slice(1000, 2000)), strict=True):
        np.testing.assert_array_equal(piece.time, swing.time[rows])
        np.testing.assert_array_equal(
            piece.column("hip.position"), swing.columns["hip.position"][rows]
        )
    assert warning.startswith("run.csv: samples are missing for 0.402 s at 1.598 s.")
    assert "0.000..1.598 s, 2.000..3.998 s" in warning
    # Short pieces are left out, and many holes refused.
    pieces, _ = cut_at_gaps([without_rows(swing, (300, 400))])
    assert [piece.source.part for piece in pieces] == ["0.800..3.998 s"]
    holes = [(start, start + 20) for start in range(300, 2000, 300)]
    with pytest.raises(LogError, match=r"run.csv: samples are missing in 6 places.*only 0 of"):
        cut_at_gaps([without_rows(named, *holes)])


def test_a_piece_in_which_nothing_changes_is_told_by_the_check(swing: Log) -> None:
    """The diagnosis refuses it, and the check looked at the whole log."""
    dead = {n: np.where(swing.time < 1.9, v, v[-1]) for n, v in swing.columns.items()}
    log = without_rows(swing.with_columns(dead), (800, 1000))
    found = check_log(log, load_robot("planar_leg_fixed")).of_kind("constant_log")
    assert [finding.severity for finding in found] == ["error"]


def test_single_lost_samples_and_slow_clocks_are_no_reason_to_cut(swing: Log) -> None:
    lost = without_rows(swing, (500, 503), (900, 901))
    uneven = np.random.default_rng(0).uniform(-0.4, 0.4, 2000) * 0.002
    slow = [Log(25.0 * swing.time, swing.columns), Log(swing.time + uneven, swing.columns)]
    logs = [swing, lost, *slow]
    assert cut_at_gaps(logs) == (logs, [])
