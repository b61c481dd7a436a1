"""Holes in the time of a log."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.errors import LogError
from wbc.measurement import Log, LogSource, check_log, cut_at_gaps


def _without(log: Log, *rows: tuple[int, int]) -> Log:
    """Return a log that has lost the rows start <= row < stop."""
    kept = np.ones(len(log), dtype=bool)
    for start, stop in rows:
        kept[start:stop] = False
    columns = {name: values[kept] for name, values in log.columns.items()}
    return Log(log.time[kept], columns, LogSource(path="run.csv"))


def test_a_hole_is_no_wrap_of_the_encoder_that_moves_on_meanwhile(swing: Log) -> None:
    turn = swing.with_columns({"hip.position": 0.5 * np.sin(2.0 * swing.time)})
    findings = check_log(_without(turn, (1200, 1500))).findings
    assert [finding.kind for finding in findings] == ["gap"]
    wrapped = turn.column("hip.position") + 2.0 * np.pi * (swing.time > 1.0)
    log = _without(turn.with_columns({"hip.position": wrapped}), (1200, 1500))
    assert {finding.kind for finding in check_log(log).findings} == {"gap", "wrap"}


def test_a_log_is_cut_where_samples_are_missing(swing: Log) -> None:
    holed = _without(swing, (800, 1000))
    pieces, warnings = cut_at_gaps([swing, holed])
    assert pieces[0] is swing
    assert [piece.source.label for piece in pieces[1:]] == [
        "run.csv#0.000..1.598 s",
        "run.csv#2.000..3.998 s",
    ]
    for piece, rows in zip(pieces[1:], (slice(0, 800), slice(1000, 2000)), strict=True):
        np.testing.assert_array_equal(piece.time, swing.time[rows])
        np.testing.assert_array_equal(
            piece.column("hip.position"), swing.columns["hip.position"][rows]
        )
    (warning,) = warnings
    assert warning.startswith("run.csv: samples are missing for 0.402 s at 1.598 s.")
    assert "0.000..1.598 s, 2.000..3.998 s" in warning


def test_short_pieces_are_left_out_and_many_holes_refused(swing: Log) -> None:
    pieces, _ = cut_at_gaps([_without(swing, (300, 400))])
    assert [piece.source.part for piece in pieces] == ["0.800..3.998 s"]
    holes = [(start, start + 20) for start in range(300, 2000, 300)]
    with pytest.raises(LogError, match=r"run.csv: samples are missing in 6 places.*only 0 s of"):
        cut_at_gaps([_without(swing, *holes)])


def test_single_lost_samples_and_slow_clocks_are_no_reason_to_cut(swing: Log) -> None:
    lost = _without(swing, (500, 503), (900, 901))
    uneven = np.random.default_rng(0).uniform(-0.4, 0.4, 2000) * 0.002
    slow = [Log(25.0 * swing.time, swing.columns), Log(swing.time + uneven, swing.columns)]
    logs = [swing, lost, *slow]
    assert cut_at_gaps(logs) == (logs, [])
