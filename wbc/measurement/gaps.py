"""Where samples are missing, and logs cut there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.errors import LogError
from wbc.measurement.log import Log

GAP_STEPS = 5.0
"""A distance of two time stamps is a gap from this multiple of the median distance."""

CUT_FROM = 0.02
"""Logs are cut at gaps longer than this [s]: a straight line bridges shorter ones well enough."""

_LEAST_ROWS, _LEAST_DURATION = 50, 1.0  # of a piece [s]


def gaps(time: FloatArray) -> IntArray:
    """Return the rows (n,) of time stamps (N,) after which samples are missing."""
    steps = np.diff(time)
    return np.flatnonzero(steps > GAP_STEPS * float(np.median(steps)))


def cut_at_gaps(logs: Sequence[Log]) -> tuple[list[Log], list[str]]:
    """Return the logs cut where samples are missing, and a warning for each log that was cut.

    A piece is a log of its own, `FILE#START..STOP s`; pieces too short to say anything are left
    out. Logs without gaps are returned as they are.

    Raises:
        LogError: less than half of a log is left in pieces that are long enough.
    """
    whole, warnings = [], []
    for log in logs:
        rows = gaps(log.time)
        rows = rows[log.time[rows + 1] - log.time[rows] > CUT_FROM]
        if not rows.size:
            whole.append(log)
            continue
        pieces = _pieces(log, rows)
        kept = sum(piece.duration for piece in pieces)
        where = _described(log, rows)
        if kept < 0.5 * log.duration:
            raise LogError(
                f"{log.source.label}: {where}, and only {kept:.3g} s of {log.duration:.3g} s are "
                "left in pieces long enough to be used. Record with the drive's own clock, without "
                "losses."
            )
        whole += pieces
        warnings.append(
            f"{log.source.label}: {where}. The log is cut there; used are "
            f"{', '.join(_span(piece) for piece in pieces)}. Runs cut in different places are not "
            "seen to repeat one another."
        )
    return whole, warnings


def _pieces(log: Log, rows: IntArray) -> list[Log]:
    ends = [0, *(int(row) + 1 for row in rows), len(log)]
    pieces = []
    for start, stop in pairwise(ends):
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
