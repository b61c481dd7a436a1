"""The clock of a log: where samples are missing, stamps repeat, and runs begin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import LogError
from wbc.measurement.column_map import Mend, say_so
from wbc.measurement.log import Log, LogFinding

GAP_STEPS = 5.0
"""A distance of two time stamps is a gap from this multiple of the median distance."""

CUT_FROM = 0.02
"""Logs are cut at gaps longer than this [s]: a straight line bridges shorter ones well enough."""

ENCODER_BITS = range(9, 21)
"""Of encoders: a turn has two to the power of one of these counts."""

_LEAST_ROWS, _LEAST_DURATION = 50, 1.0  # of a piece [s]
_SHORTEST = 0.5  # [s] of a log
PERIODS = {2.0 * np.pi: "one turn", np.pi: "half a turn", 360.0: "360 deg"}
PERIODS |= {2.0**bits: f"2^{bits} encoder counts" for bits in ENCODER_BITS}
"""What a position jumps by where it starts again -> in words."""

_PERIOD = 0.05  # by which a jump may miss the turn or the range of counts that it is
_LEAP = 10.0  # times what 99 of 100 steps of a joint are below; a lost sample makes two
_FAR = 0.1  # [s] between stamps, beyond which nobody can tell where a robot was between them


def gaps(time: FloatArray) -> IntArray:
    """Return the rows (n,) of time stamps (N,) after which samples are missing."""
    steps = np.diff(time)
    return np.flatnonzero(steps > GAP_STEPS * float(np.median(steps)))


def cut_at_gaps(logs: Sequence[Log]) -> tuple[list[Log], list[str]]:
    """Return the logs cut where samples are missing, and a warning for each log that was cut.

    A piece is a log of its own, `FILE#START..STOP s`; pieces too short to say anything are left
    out. Logs without gaps are returned as they are.

    Raises:
        LogError: less than half of the rows of a log are left in pieces that are long enough.
    """
    whole, warnings = [], []
    for log in logs:
        cuts = _cuts(log)
        if not cuts.size:
            whole.append(log)
            continue
        widths, at = log.time[cuts + 1] - log.time[cuts], log.time[cuts[0]]
        where = f"samples are missing for {widths[0]:.3g} s at {at:.3f} s"
        if cuts.size > 1:
            where = f"samples are missing in {cuts.size} places, first for {widths[0]:.3g} s at "
            where += f"{at:.3f} s, at most for {widths.max():.3g} s"
        long = [piece for piece in _pieces(log, cuts) if piece.duration >= _LEAST_DURATION]
        kept = sum(map(len, long))
        if kept < 0.5 * len(log):
            raise LogError(
                f"{log.source.label}: {where}, and only {kept} of {len(log)} rows are left in "
                "pieces long enough to be used. Record with the drive's own clock, without losses."
            )
        spans = [f"{piece.time[0]:.3f}..{piece.time[-1]:.3f} s" for piece in long]
        for piece, span in zip(long, spans, strict=True):
            part = f"{log.source.part} {span}".lstrip()
            whole.append(replace(piece, source=replace(log.source, part=part)))
        warnings.append(
            f"{log.source.label}: {where}. The log is cut there; used are {', '.join(spans)}. Runs "
            "cut in different places are not seen to repeat one another."
        )
    return whole, warnings


def longest_piece(log: Log) -> Log:
    """Return the longest part of a log in which no samples are missing."""
    return max(_pieces(log, _cuts(log)), key=len, default=log[:2])


def _cuts(log: Log) -> IntArray:
    """Return the rows (n,) after which a log is cut."""
    rows = gaps(log.time)
    return rows[log.time[rows + 1] - log.time[rows] > CUT_FROM]


def _pieces(log: Log, cuts: IntArray) -> list[Log]:
    parts = pairwise([0, *(cuts + 1).tolist(), len(log)])
    return [log[start:stop] for start, stop in parts if stop - start >= _LEAST_ROWS]


def too_short(log: Log) -> LogFinding | None:
    """Return that a log is too short to say anything, None for a longer one."""
    if log.duration >= _SHORTEST and len(log) >= _LEAST_ROWS:
        return None
    text = f"{log.duration:.2g} s with {len(log)} rows are too short to say anything."
    return LogFinding("error", "short", "", text, "Record at least a few seconds of motion.")


def restarts(time: FloatArray) -> IntArray:
    """Return the rows (n,) at which a clock starts again: another run follows in the same file.

    The stamp falls back by more than half of what had passed, and stays there for a run; rows that
    are out of order do not.
    """
    back = np.flatnonzero(np.diff(time) < 0.0) + 1
    begin, found = 0, []
    for row, end in pairwise([*back.tolist(), time.size]):
        elapsed = time[row - 1] - time[begin]
        again = time[row] - time[begin] < 0.5 * elapsed
        if again and row - begin >= _LEAST_ROWS and end - row >= _LEAST_ROWS:
            found.append(row)
            begin = row
    return np.array(found, dtype=np.int_)


def leaps(time: FloatArray, positions: Sequence[FloatArray]) -> IntArray:
    """Return the rows (n,) at which joints are elsewhere at once, though the clock just goes on.

    One joint alone may be reset, and several may wrap; two that leap together and stay there for a
    run begin another one.
    """
    if len(positions) < 2 or time.size < _LEAST_ROWS:
        return np.zeros(0, dtype=np.int_)
    steps = np.abs(np.diff(np.stack(list(positions)), axis=1))
    steps[period(steps) > 0.0] = 0.0
    usual = np.quantile(steps, 0.99, axis=1, keepdims=True)
    second = np.sort(steps / np.maximum(usual, 1e-300), axis=0)[-2]
    rows = np.setdiff1d(np.flatnonzero(second > _LEAP), gaps(time)) + 1
    runs = np.diff([0, *rows.tolist(), time.size]) >= _LEAST_ROWS
    return rows[runs[:-1] & runs[1:]].astype(np.int_)


def period(steps: FloatArray) -> FloatArray:
    """Return the period (...) by which steps (...) of a position may start it again, 0 for none.

    The joint goes on moving meanwhile, so a step is only close to its period.
    """
    known = np.array(list(PERIODS))
    away = np.abs(np.abs(steps)[..., None] / known - 1.0)
    return np.where(away.min(axis=-1) < _PERIOD, known[away.argmin(axis=-1)], 0.0)


def repeated_mend(time: FloatArray, columns: Mapping[str, FloatArray]) -> Mend:
    """Return what a map says of time stamps that repeat; empty where their digits were lost.

    Rows of one stamp that differ are samples that were stamped together: they are spread over the
    time until the next stamp. Rows that are the same are one sample, sent again.
    """
    steps = np.diff(time)
    shared = steps == 0.0
    if np.mean(shared) > 0.5 and _usual(steps) > _FAR:
        return {}
    held = np.stack(list(columns.values()), axis=1) if columns else np.zeros((time.size, 0))
    moved = np.any(held[1:] != held[:-1], axis=1)
    several = int(np.count_nonzero(shared & moved)) > 0.5 * int(np.count_nonzero(shared))
    return {"time": {"repeated": "spread" if several else "first"}}


def advancing(
    time: FloatArray, columns: Mapping[str, FloatArray], repeated: str, rows: IntArray, label: str
) -> tuple[FloatArray, BoolArray]:
    """Return time stamps that increase strictly, and the rows (N,) that they are of.

    Args:
        time: (N,) [s] as the file has it.
        columns: what was measured.
        repeated: `error`, `first` or `spread`, see `TimeRule`.
        rows: numbers of the rows in the file, for messages.
        label: of the log.

    Raises:
        LogError: time goes back or is NaN; it repeats and `repeated` is `error`; or so many rows
            share a stamp that the clock must have lost digits.
    """
    steps = np.diff(time, prepend=-np.inf)
    bad, kept = np.flatnonzero(~(steps > 0.0)), steps > 0.0
    if not bad.size:
        return time, kept
    place = f"at row {rows[bad[0]]} ({time[bad[0]]:.9g} s; {bad.size} such rows of {time.size})"
    if not np.isfinite(time).all():
        raise LogError(f"{label}: time is NaN {place}. Leave such rows out.")
    if (steps < 0.0).any():
        row = int(np.argmax(steps < 0.0))
        raise LogError(
            f"{label}: time goes back at row {rows[row]} ({time[row - 1]:.9g} s, then "
            f"{time[row]:.9g} s; {np.count_nonzero(steps < 0.0)} such rows). Sort the file by time "
            "if its rows were stored out of order."
        )
    if not (mend := repeated_mend(time, columns)):
        rate: Mend = {"time": {"rate": 100}}
        raise LogError(
            f"{label}: {bad.size} of {time.size} rows share a time stamp with the row before, and "
            f"stamps that differ are {_usual(steps):g} s apart: digits of the clock were lost. "
            "Export the clock with more digits. If the rows are evenly spaced, give `wbc init` "
            f"their rate, --rate HZ, or put it in place of 100, and {say_so(rate)}"
        )
    if repeated == "first":
        return time[kept], kept
    if repeated == "spread":
        first = np.flatnonzero(kept)
        counts, widths = np.diff([*first, time.size]), np.diff(time[first])
        widths = np.append(widths, np.median(widths) if widths.size else 1.0)
        within = np.arange(time.size) - np.repeat(first, counts)
        spread = np.asarray(time + within * np.repeat(widths / counts, counts))
        return spread, np.ones(time.size, dtype=bool)
    ways = {"spread": "spread rows over the time between stamps", "first": "keep the first of each"}
    way = say_so(mend, ways[mend["time"]["repeated"]])
    raise LogError(f"{label}: time repeats {place}. To {way}")


def _usual(steps: FloatArray) -> float:
    """Return the usual time [s] between stamps that differ."""
    later = steps[(steps > 0.0) & np.isfinite(steps)]
    return float(np.median(later)) if later.size else np.inf
