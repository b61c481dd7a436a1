"""The noise floor of the channels of logs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError, unknown_name
from wbc.measurement.local_noise import residual_noise
from wbc.measurement.log import Log
from wbc.measurement.noise_floor import NoiseFloor
from wbc.measurement.repeats import find_repeats, on_clock


def noise_floor(logs: Sequence[Log], groups: Sequence[Sequence[int]] | None = None) -> NoiseFloor:
    """Return the noise of every channel, from repeats if there are any.

    Args:
        logs: of one robot, at least one.
        groups: indices of logs that repeat each other; None to look for them.

    Raises:
        LogError: no logs, or a group that refers to a log that is not there.
    """
    if not logs:
        raise LogError("no logs to take a noise floor from.")
    chosen = find_repeats(logs) if groups is None else tuple(tuple(group) for group in groups)
    for index in (k for group in chosen for k in group):
        if not 0 <= index < len(logs):
            known = [str(k) for k in range(len(logs))]
            raise LogError(unknown_name("log", str(index), known))
    chosen = tuple(group for group in chosen if len(group) > 1)
    names = [name for name in logs[0].names if all(log.has(name) for log in logs)]
    if not chosen:
        levels = {n: _pooled([residual_noise(g.time, g.column(n)) for g in logs]) for n in names}
        return NoiseFloor(levels, pairs=0, groups=())
    elapsed = [logs[group[0]].time - logs[group[0]].time[0] for group in chosen]
    levels = {
        name: _pooled(
            [
                repeat_deviation([on_clock(logs[k], name, clock) for k in group])
                for group, clock in zip(chosen, elapsed, strict=True)
            ]
        )
        for name in names
    }
    pairs = sum(len(group) * (len(group) - 1) // 2 for group in chosen)
    return NoiseFloor(levels, pairs, chosen)


def repeat_deviation(series: Sequence[FloatArray]) -> float:
    """Return the standard deviation of one run about the mean of its repeats.

    With m repeats x_k (N,) of one signal plus independent noise of level s, the expectation of
    sum_k (x_k - mean)^2 / (m - 1) is s^2; for two it is (a - b)^2 / 2.

    Args:
        series: two or more aligned arrays of one shape; residuals of a model as well as channels.

    Raises:
        LogError: fewer than two, or shapes that differ.
    """
    shapes = {np.shape(values) for values in series}
    if len(series) < 2 or len(shapes) != 1:
        raise LogError(f"repeats need two or more series of one shape, got {sorted(shapes)}.")
    stacked = np.stack(series)
    return float(np.sqrt(np.mean(np.var(stacked, axis=0, ddof=1))))


def _pooled(levels: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(levels))))
