"""Findings about sensors that hold one value while the joint goes on moving."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scipy.integrate import trapezoid

from wbc.arrays import FloatArray
from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.checks.value_runs import longest_true_run
from wbc.measurement.log import Log

_SECONDS = 0.1
_SAMPLES = 5
_END_SHARE = 0.2


def check_stuck(log: Log, resting: Collection[str] = ()) -> list[LogFinding]:
    """Return findings about positions and velocities that are held for a while.

    A value that is held and then jumps by what the other sensor saw meanwhile was lost; a joint
    that rests, or a coarse sensor, does not jump. At the end of a log there is no jump to see:
    there the other sensor must show a fifth of the whole motion.

    Args:
        log: the log.
        resting: joints that stand still throughout; nothing of theirs is lost.
    """
    findings: list[LogFinding] = []
    for joint in log.with_quantity("position"):
        if joint in resting or not log.has(f"{joint}.velocity"):
            continue
        position, velocity = log.column(f"{joint}.position"), log.column(f"{joint}.velocity")
        if np.ptp(position) == 0.0 or np.ptp(velocity) == 0.0:
            continue
        for name, values in ((f"{joint}.position", position), (f"{joint}.velocity", velocity)):
            start, length = longest_true_run(np.diff(values) == 0.0)
            seconds = float(log.time[start + length] - log.time[start])
            if length < _SAMPLES or seconds < _SECONDS:
                continue
            # The later half alone: a velocity that lags behind dies out in the first.
            rows = slice(start + length // 2, start + length + 1)
            seen = abs(float(trapezoid(velocity[rows], log.time[rows])))
            if values is velocity:
                seen = abs(float(position[rows][-1] - position[rows][0])) - seen
                held = abs(seen) > 0.0 and _released(values, rows.stop, 0.1 * np.ptp(velocity))
            else:
                held = seen > 0.0 and _released(values, rows.stop, seen)
                held = held and seen > 2.0 * _usual_step(position)
            lost = abs(seen) > _END_SHARE * np.ptp(position)
            if held if rows.stop < len(log) else lost:
                findings.append(_finding(name, float(log.time[start]), seconds))
    return findings


def _released(values: FloatArray, row: int, least: float) -> bool:
    """Whether a channel jumps by `least` at `row`, far beyond its usual steps."""
    if row >= values.size:
        return False
    return bool(abs(values[row] - values[row - 1]) > max(least, 5.0 * _usual_step(values)))


def _usual_step(values: FloatArray) -> float:
    steps = np.abs(np.diff(values))
    return float(np.median(steps[steps > 0.0]))


def _finding(name: str, start: float, seconds: float) -> LogFinding:
    return LogFinding(
        "error",
        "stuck",
        name,
        f"one value for {seconds:.3f} s from {start:.3f} s on, while the joint moves.",
        "The sensor or its link dropped out: leave that time out (log.between).",
    )
