"""Straight lines through what machines show over time, and which slopes are no chance.

Every session has its interval; sessions also differ by more than that (temperature, mounting).
This scatter is taken to be the same for the machines given and is estimated from all of them
together (Paule and Mandel): the more machines, the surer it is. A slope is judged by Student's t;
of many slopes judged at once one in twenty may be wrong altogether (Holm).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student

from wbc.arrays import FloatArray

WRONG = 0.05
"""Chance that any of the slopes called a drift is none."""
_EXACT = 1e-6  # of the largest value: an interval without width is not without error


@dataclass(frozen=True, eq=False)
class Points:
    """One quantity of one machine.

    Attributes:
        time: (n,) [days].
        value: (n,).
        deviation: (n,) standard deviation of each value.
    """

    time: FloatArray
    value: FloatArray
    deviation: FloatArray


@dataclass(frozen=True)
class Line:
    """A straight line through points.

    Attributes:
        middle: mean time, weighted [days].
        level: value there.
        slope: per day.
        deviation: standard deviation of the slope; infinite for points at one time.
        chance: probability of so steep a slope without any drift; NaN where no machine has three
            sessions.
    """

    middle: float
    level: float
    slope: float
    deviation: float
    chance: float


def fit_lines(points: Mapping[str, Points]) -> tuple[dict[str, Line], float]:
    """Return a line per machine, and the scatter between sessions beyond their intervals.

    Args:
        points: machine -> one quantity of it.
    """
    sizes = np.concatenate([np.abs(p.value) for p in points.values()])
    least = _EXACT * float(sizes.max(initial=0.0)) + 1e-300
    freedom = sum(max(_times(p) - 2, 0) for p in points.values())

    def excess(scatter: float) -> float:
        return sum(_misfit(p, scatter, least) for p in points.values()) - freedom

    scatter = 0.0
    if freedom > 0 and excess(0.0) > 0.0:
        most = max(float(np.ptp(p.value)) for p in points.values()) + least
        while excess(most) > 0.0:
            most *= 2.0
        scatter = float(brentq(excess, 0.0, most, xtol=1e-4 * most))
    return {name: _line(p, scatter, least, freedom) for name, p in points.items()}, scatter


def no_chance(chances: Sequence[float]) -> list[bool]:
    """Return which of many probabilities are too small for chance, at `WRONG` altogether."""
    order = sorted((k for k, p in enumerate(chances) if np.isfinite(p)), key=lambda k: chances[k])
    found = [False] * len(chances)
    for rank, k in enumerate(order):
        if chances[k] * (len(order) - rank) > WRONG:
            break
        found[k] = True
    return found


def _times(points: Points) -> int:
    return int(np.unique(points.time).size)


def _weights(points: Points, scatter: float, least: float) -> FloatArray:
    return np.asarray(1.0 / (np.maximum(points.deviation, least) ** 2 + scatter**2))


def _misfit(points: Points, scatter: float, least: float) -> float:
    """Return the sum of squares about the line in standard deviations; 0 through two points."""
    if _times(points) < 3:
        return 0.0
    line = _line(points, scatter, least, 1)
    away = points.value - line.level - line.slope * (points.time - line.middle)
    return float(np.sum(_weights(points, scatter, least) * away**2))


def _line(points: Points, scatter: float, least: float, freedom: int) -> Line:
    weight = _weights(points, scatter, least)
    middle = float(np.average(points.time, weights=weight))
    level = float(np.average(points.value, weights=weight))
    away = points.time - middle
    lever = float(np.sum(weight * away**2))
    if _times(points) < 2:
        return Line(middle, level, 0.0, np.inf, np.nan)
    slope = float(np.sum(weight * away * points.value)) / lever
    deviation = 1.0 / np.sqrt(lever)
    chance = 2.0 * float(student.sf(abs(slope) / deviation, freedom)) if freedom else np.nan
    return Line(middle, level, slope, float(deviation), chance)
