"""The clock of a log: where samples are missing, stamps repeat, and runs begin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import LogError
from wbc.measurement.column_map import Mend, say_so

GAP_STEPS = 5.0
"""A distance of two time stamps is a gap from this multiple of the median distance."""

ENCODER_BITS = range(9, 21)
"""Of encoders: a turn has two to the power of one of these counts."""

LEAST_ROWS = 50
"""Rows of a run that can say something."""
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
        if again and row - begin >= LEAST_ROWS and end - row >= LEAST_ROWS:
            found.append(row)
            begin = row
    return np.array(found, dtype=np.int_)


def leaps(time: FloatArray, positions: Sequence[FloatArray]) -> IntArray:
    """Return the rows (n,) at which joints are elsewhere at once, though the clock just goes on.

    One joint alone may be reset, and several may wrap; two that leap together and stay there for a
    run begin another one.
    """
    if len(positions) < 2 or time.size < LEAST_ROWS:
        return np.zeros(0, dtype=np.int_)
    steps = np.abs(np.diff(np.stack(list(positions)), axis=1))
    steps[period(steps) > 0.0] = 0.0
    usual = np.quantile(steps, 0.99, axis=1, keepdims=True)
    second = np.sort(steps / np.maximum(usual, 1e-300), axis=0)[-2]
    rows = np.setdiff1d(np.flatnonzero(second > _LEAP), gaps(time)) + 1
    runs = np.diff([0, *rows.tolist(), time.size]) >= LEAST_ROWS
    return rows[runs[:-1] & runs[1:]].astype(np.int_)


def period(steps: FloatArray) -> FloatArray:
    """Return the period (...) by which steps (...) of a position may start it again, 0 for none.

    The joint goes on moving meanwhile, so a step is only close to its period.
    """
    known = np.array(list(PERIODS))
    away = np.abs(np.abs(steps)[..., None] / known - 1.0)
    return np.where(away.min(axis=-1) < _PERIOD, known[away.argmin(axis=-1)], 0.0)


def repeated_mend(
    time: FloatArray, columns: Mapping[str, FloatArray], rows: IntArray, label: str
) -> Mend:
    """Return what a map says of time stamps that repeat; empty where they increase strictly.

    Rows of one stamp that differ are samples that were stamped together: they are spread over the
    time until the next stamp. Rows that are the same are one sample, sent again.

    Args:
        time: (N,) [s] as the file has it.
        columns: what was measured.
        rows: numbers of the rows in the file, for messages.
        label: of the log.

    Raises:
        LogError: time is no number, goes back, or so many rows share a stamp that the clock must
            have lost digits.
    """
    steps = np.diff(time)
    for k in np.flatnonzero(~np.isfinite(time))[:1]:
        raise LogError(f"{label}: time is {time[k]} at row {rows[k]}. Leave such rows out.")
    for k in (back := np.flatnonzero(steps < 0.0))[:1]:
        held = f"{time[k]:.9g} s, then {time[k + 1]:.9g} s; {back.size} such rows"
        way = "Sort rows that were stored out of order."
        raise LogError(f"{label}: time goes back at row {rows[k + 1]} ({held}). {way}")
    shared = steps == 0.0
    if not shared.any():
        return {}
    usual = np.inf if shared.all() else float(np.median(steps[~shared]))
    if np.mean(shared) > 0.5 and usual > _FAR:
        raise LogError(
            f"{label}: {np.sum(shared)} of {time.size} rows share a time stamp with the row "
            f"before, and stamps that differ are {usual:g} s apart: digits of the clock were lost. "
            "Export the clock with more digits. If the rows are evenly spaced, give `wbc init` "
            "their rate, --rate HZ, or put it in place of 100, and "
            + say_so({"time": {"rate": 100}})
        )
    moved = [np.diff(values) != 0.0 for values in columns.values()]
    several = np.sum(shared & np.any(moved, axis=0)) > 0.5 * np.sum(shared) if moved else False
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
        LogError: as `repeated_mend`; or time repeats and `repeated` is `error`.
    """
    mend = repeated_mend(time, columns, rows, label)
    kept = np.diff(time, prepend=-np.inf) > 0.0
    if not mend or repeated == "first":
        return time[kept], kept
    if repeated == "spread":
        first = np.flatnonzero(kept)
        counts, widths = np.diff([*first, time.size]), np.diff(time[first])
        widths = np.append(widths, np.median(widths) if widths.size else 1.0)
        within = np.arange(time.size) - np.repeat(first, counts)
        spread = np.asarray(time + within * np.repeat(widths / counts, counts))
        return spread, np.ones(time.size, dtype=bool)
    k, count = int(np.argmin(kept)), np.count_nonzero(~kept)
    ways = {"spread": "spread rows over the time between stamps", "first": "keep the first of each"}
    held = f"{time[k]:.9g} s; {count} such rows of {time.size}"
    way = say_so(mend, ways[mend["time"]["repeated"]])
    raise LogError(f"{label}: time repeats at row {rows[k]} ({held}). To {way}")
