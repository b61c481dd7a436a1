"""The clock of a log: where samples are missing, stamps repeat and runs begin; logs that repeat."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import LogError
from wbc.measurement.filters import residual_noise
from wbc.measurement.findings import LogFinding, Mend, say_so
from wbc.measurement.log import Log

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
        rows = _cuts(log)
        if not rows.size:
            whole.append(log)
            continue
        pieces = _pieces(log, rows)
        kept = sum(map(len, pieces))
        where = _described(log, rows)
        if kept < 0.5 * len(log):
            raise LogError(
                f"{log.source.label}: {where}, and only {kept} of {len(log)} rows are left in "
                "pieces long enough to be used. Record with the drive's own clock, without losses."
            )
        whole += pieces
        warnings.append(
            f"{log.source.label}: {where}. The log is cut there; used are "
            f"{', '.join(_span(piece) for piece in pieces)}. Runs cut in different places are not "
            "seen to repeat one another."
        )
    return whole, warnings


def longest_piece(log: Log) -> Log:
    """Return the longest part of a log in which no samples are missing."""
    rows = _cuts(log)
    start, stop = max(_between(log, rows), key=lambda piece: piece[1] - piece[0])
    return log[start:stop] if rows.size else log


def _cuts(log: Log) -> IntArray:
    """Return the rows (n,) after which a log is cut."""
    rows = gaps(log.time)
    return rows[log.time[rows + 1] - log.time[rows] > CUT_FROM]


def _between(log: Log, rows: IntArray) -> list[tuple[int, int]]:
    """Return the first row of every piece, and the one after its last."""
    return list(pairwise([0, *(int(row) + 1 for row in rows), len(log)]))


def _pieces(log: Log, rows: IntArray) -> list[Log]:
    pieces = []
    for start, stop in _between(log, rows):
        long = stop - start >= _LEAST_ROWS
        if long and log.time[stop - 1] - log.time[start] >= _LEAST_DURATION:
            piece = log[start:stop]
            part = f"{log.source.part} {_span(piece)}".lstrip()
            pieces.append(piece.with_source(replace(log.source, part=part)))
    return pieces


def _described(log: Log, rows: IntArray) -> str:
    widths = log.time[rows + 1] - log.time[rows]
    at, width = float(log.time[rows[0]]), float(widths[0])
    if rows.size == 1:
        return f"samples are missing for {width:.3g} s at {at:.3f} s"
    return (
        f"samples are missing in {rows.size} places, first for {width:.3g} s at {at:.3f} s, at "
        f"most for {widths.max():.3g} s"
    )


def _span(log: Log) -> str:
    return f"{log.time[0]:.3f}..{log.time[-1]:.3f} s"


def too_short(log: Log) -> LogFinding | None:
    """Return that a log is too short to say anything, None for a longer one."""
    if log.duration >= _SHORTEST and len(log) >= _LEAST_ROWS:
        return None
    text = f"{log.duration:g} s with {len(log)} rows are too short to say anything."
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
    """Return the period by which each step of a position may start it again, 0 for none.

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
    time: FloatArray,
    columns: Mapping[str, FloatArray],
    repeated: str,
    rows: IntArray,
    label: str,
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
    steps = np.diff(time)
    bad = np.flatnonzero(~(steps > 0.0)) + 1
    everything = np.ones(time.size, dtype=bool)
    if not bad.size:
        return time, everything
    place = f"at row {rows[bad[0]]} ({time[bad[0]]:.9g} s; {bad.size} such rows of {time.size})"
    if not np.isfinite(time).all():
        raise LogError(f"{label}: time is NaN {place}. Leave such rows out.")
    if (steps < 0.0).any():
        row = int(np.flatnonzero(steps < 0.0)[0]) + 1
        raise LogError(
            f"{label}: time goes back at row {rows[row]} ({time[row - 1]:.9g} s, then "
            f"{time[row]:.9g} s; {np.count_nonzero(steps < 0.0)} such rows). Sort the file by time "
            "if its rows were stored out of order."
        )
    mend = repeated_mend(time, columns)
    if not mend:
        rate: Mend = {"time": {"rate": 100}}
        raise LogError(
            f"{label}: {bad.size} of {time.size} rows share a time stamp with the row before, and "
            f"{_apart(steps)}: digits of the clock were lost. Export the "
            "clock with more digits. If the rows are evenly spaced, give `wbc init` their rate, "
            f"--rate HZ, or put it in place of 100, and {say_so(rate)}"
        )
    if repeated == "first":
        return time[steps_kept(steps)], steps_kept(steps)
    if repeated == "spread":
        return _spread(time, steps), everything
    ways = {"spread": "spread rows over the time between stamps", "first": "keep the first of each"}
    best = mend["time"]["repeated"]
    way = say_so(mend, ways[best])
    raise LogError(f"{label}: time repeats {place}. To {way}")


def steps_kept(steps: FloatArray) -> BoolArray:
    """Return the rows (N,) whose stamp is later than the one before, from N - 1 steps."""
    return np.concatenate([[True], steps > 0.0])


def _spread(time: FloatArray, steps: FloatArray) -> FloatArray:
    first = np.flatnonzero(steps_kept(steps))
    counts = np.diff([*first, time.size])
    widths = np.diff(time[first])
    widths = np.append(widths, np.median(widths) if widths.size else 1.0)
    within = np.arange(time.size) - np.repeat(first, counts)
    return np.asarray(time + within * np.repeat(widths / counts, counts))


def _apart(steps: FloatArray) -> str:
    """Return how far the stamps that differ are apart, in words."""
    usual = _usual(steps)
    return f"the stamps are {usual:g} s apart" if np.isfinite(usual) else "no stamp differs"


def _usual(steps: FloatArray) -> float:
    """Return the usual time [s] between stamps that differ."""
    later = steps[steps > 0.0]
    return float(np.median(later)) if later.size else np.inf


_REPEATS = 0.05  # largest rms distance of two positions, relative to their motion, of repeats

_NOISE_ALLOWANCE = 3.0


def find_repeats(logs: Sequence[Log]) -> tuple[tuple[int, ...], ...]:
    """Return groups of logs of the same excitation, as indices into `logs`.

    Two logs belong together when they have the same joints, the same length and rate within 1 %,
    and every joint's position (without one, its velocity) agrees within 5 % of its motion
    (rms, time counted from the start). The response may thus differ a little, as a closed loop
    makes it; identical copies are no repeats and stay out (the first of them counts).

    Args:
        logs: of one robot.

    Returns:
        Groups of two or more indices, in order of their first member.
    """
    copies = {k for group in find_duplicates(logs) for k in group[1:]}
    groups: list[list[int]] = []
    for k, log in enumerate(logs):
        if k in copies:
            continue
        home = next((g for g in groups if _same_excitation(logs[g[0]], log)), None)
        if home is None:
            groups.append([k])
        else:
            home.append(k)
    return tuple(tuple(group) for group in groups if len(group) > 1)


def find_duplicates(logs: Sequence[Log]) -> tuple[tuple[int, ...], ...]:
    """Return groups of logs that hold the same data, as indices into `logs`.

    The same file counts, and so does the same data in other files (time counted from the start).
    """
    seen: dict[str, list[int]] = {}
    for k, log in enumerate(logs):
        seen.setdefault(_fingerprint(log), []).append(k)
    return tuple(tuple(group) for group in seen.values() if len(group) > 1)


def _fingerprint(log: Log) -> str:
    """Return a digest of the data: nine decimals, so that another file format changes nothing."""
    total = hashlib.sha256()
    for name in sorted(log.names):
        total.update(name.encode("utf-8"))
        total.update(np.round(log.column(name), 9).tobytes())
    total.update(np.round(log.time - log.time[0], 6).tobytes())
    return total.hexdigest()


def _same_excitation(a: Log, b: Log) -> bool:
    names = _motions(a)
    if names != _motions(b) or not names:
        return False
    if abs(a.duration / b.duration - 1.0) > 0.01 or abs(a.sample_time / b.sample_time - 1.0) > 0.01:
        return False
    moved = 0
    for name in names:
        difference, motion, noise = _distance(a, b, name)
        # A joint that stands still repeats its place within the noise of its sensor.
        if difference > _REPEATS * motion + _NOISE_ALLOWANCE * noise:
            return False
        moved += motion > _NOISE_ALLOWANCE * noise
    return moved > 0


def _motions(log: Log) -> tuple[str, ...]:
    """Return the column that shows how each joint moves: its position, else its velocity."""
    placed = log.with_quantity("position")
    others = [joint for joint in log.with_quantity("velocity") if joint not in placed]
    return (*(f"{joint}.position" for joint in placed), *(f"{joint}.velocity" for joint in others))


def _distance(a: Log, b: Log, name: str) -> tuple[float, float, float]:
    """Return (rms difference, rms motion about the mean, noise) of one channel of two logs."""
    first = a.column(name)
    second = on_clock(b, name, a.time - a.time[0])
    motion = float(np.sqrt(np.mean((first - first.mean()) ** 2)))
    noise = residual_noise(a.time, first)
    return float(np.sqrt(np.mean((first - second) ** 2))), motion, noise


def on_clock(log: Log, name: str, elapsed: FloatArray) -> FloatArray:
    """Return a channel at times [s] since the start of its log (linear interpolation)."""
    own = log.time - log.time[0]
    values = log.column(name)
    if own.size == elapsed.size and np.allclose(own, elapsed, rtol=0.0, atol=1e-9):
        return values
    return np.asarray(np.interp(elapsed, own, values))
