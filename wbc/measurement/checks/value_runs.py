"""Patterns in the raw values of a channel: plateaus, resolution, jumps."""

from __future__ import annotations

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray

_SAMPLE_ROWS = 200_000


def longest_true_run(mask: BoolArray) -> tuple[int, int]:
    """Return (start, length) of the longest run of True; length 0 if there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    if not edges.size:
        return 0, 0
    lengths = edges[1::2] - edges[::2]
    best = int(np.argmax(lengths))
    return int(edges[2 * best]), int(lengths[best])


def resolution(values: FloatArray) -> float:
    """Return the step of a quantised channel, 0 where none shows.

    The step is the smallest distance of two values that occur, if nearly all distances of
    neighbouring values are multiples of it and values repeat as a grid makes them.
    """
    levels = np.unique(values[:_SAMPLE_ROWS])
    rows = min(values.size, _SAMPLE_ROWS)
    if levels.size < 3 or levels.size > 0.7 * rows:
        return 0.0
    span = float(levels[-1] - levels[0])
    distances = np.diff(levels)
    # Rounding in the file (single precision, printed digits) splits one level into several.
    distances = distances[distances > 1e-6 * span]
    if distances.size < 2:
        return 0.0
    step = float(np.quantile(distances, 0.05))
    multiples = distances / step
    on_grid = np.abs(multiples - np.round(multiples)) < 0.1
    if np.mean(on_grid & (multiples < 20.5)) < 0.8:
        return 0.0
    return float(np.median(distances[on_grid] / np.round(multiples[on_grid])))


def jumps(values: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return (rows, sizes) of steps far beyond every usual step of a channel.

    A jump is a step of at least 20 times the 99th percentile and a quarter of the range.
    """
    steps = np.diff(values)
    size = np.abs(steps)
    usual = float(np.quantile(size, 0.99))
    rows = np.flatnonzero((size > 20.0 * usual) & (size > 0.25 * np.ptp(values)))
    return rows, np.asarray(steps[rows])


def plateau(
    values: FloatArray, position: FloatArray | None = None
) -> tuple[float, float, float, int]:
    """Return (lowest, highest, share, runs): how much of a channel is cut off at its extremes.

    Only runs of at least three equal samples at an extreme count (a peak touches it once), and only
    those during which the joint moves (a drive that holds a pose repeats its value too).

    Args:
        values: (N,) the channel.
        position: (N,) of the joint, None if it is not known.
    """
    low, high = float(values.min()), float(values.max())
    share, runs = 0.0, 0
    for extreme in {low, high} - {0.0}:
        mask = np.concatenate([[False], values == extreme, [False]])
        edges = np.flatnonzero(np.diff(mask.astype(np.int8)))
        starts, ends = edges[::2], edges[1::2]
        counted = ends - starts >= 3
        if position is not None and counted.any():
            long = np.flatnonzero(counted)
            counted[long] = _travel(position, starts[long], ends[long]) > _least_travel(position)
        share += float(np.sum((ends - starts)[counted])) / values.size
        runs += int(np.count_nonzero(counted))
    return low, high, share, runs


def _travel(position: FloatArray, starts: IntArray, ends: IntArray) -> FloatArray:
    """Return the range of a position within runs of three rows or more (the first left out)."""
    bounds = np.stack([starts + 1, ends], axis=1).ravel()
    if bounds[-1] == position.size:
        bounds = bounds[:-1]
    highest = np.maximum.reduceat(position, bounds)[::2]
    lowest = np.minimum.reduceat(position, bounds)[::2]
    return np.asarray(highest - lowest)


def _least_travel(position: FloatArray) -> float:
    """Return what a joint at rest may seem to travel: its resolution, a thousandth of its range."""
    return float(max(2.0 * resolution(position), 1e-3 * np.ptp(position)))
