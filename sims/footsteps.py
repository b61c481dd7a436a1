"""Footholds of a humanoid and the capture point that fits to them, planned ahead.

The centre of pressure goes in straight lines from sole to sole while both feet stand, and rests
in a sole while one does. The capture point that fits to it follows backwards in time, because it
is stable that way (Englsberger, Ott & Albu-Schaeffer 2015).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import exp

import numpy as np

from sims.trotter import StepUp, minimum_jerk
from wbc.arrays import FloatArray

START = 0.5  # [s] of standing before the weight goes to the first sole
SINGLE = 0.6  # [s] that one foot stands
DOUBLE = 0.3  # [s] that both do


@dataclass(frozen=True)
class Plan:
    """Footholds and the capture point that fits to them.

    Attributes:
        holds: (k + 1, 2, 2) [m], where the left and the right sole stand after every step.
        point: (n, 2) [m], the capture point at every tick; the last one is kept.
        rate: (n, 2) [m/s], its velocity.
        rise: (n, 3) [m, m/s, m/s^2], how far the centre of mass goes up, and its two rates.
    """

    holds: FloatArray
    point: FloatArray
    rate: FloatArray
    rise: FloatArray


def equal_steps(steps: int, length: float) -> list[float]:
    """Return how far ahead every step leads, [m] from the start; the last one closes up."""
    return [length * k for k in range(1, steps)] + [length * (steps - 1)]


def planned(
    soles: FloatArray, ahead: Sequence[float], pole: float, tick: float, ground: StepUp
) -> Plan:
    """Return the plan of steps, the left foot first.

    The centre of mass goes up while the foot that stands higher bears, as far as it does.

    Args:
        soles: (2, 2) [m], x and y of the left and the right sole.
        ahead: (k,) [m], where every step leads, from the start.
        pole: sqrt(g/h) [1/s].
        tick: [s].
        ground: under the feet.
    """
    holds, steps = [soles], len(ahead)
    for step, way in enumerate(ahead):
        hold = holds[-1].copy()
        hold[step % 2] = soles[step % 2] + [way, 0.0]
        holds.append(hold)
    middle, rests = soles.mean(axis=0), [holds[k][1 - k % 2] for k in range(steps)]
    stops = [middle, *rests, holds[-1].mean(axis=0)]
    still, double, single = (round(time / tick) for time in (START, DOUBLE, SINGLE))
    pressure, rise = [np.tile(middle, (still, 1))], [np.zeros((still, 3))]
    for before, after in pairwise(stops):
        share = np.linspace(0.0, 1.0, double, endpoint=False)[:, None]
        pressure += [before + share * (after - before), np.tile(after, (single, 1))]
        rise.append(climb(ground.at(before[0]), ground.at(after[0]), double + single, tick))
    center = np.concatenate(pressure)
    point, shrink = center.copy(), exp(-pole * tick)
    for k in range(len(center) - 2, -1, -1):
        point[k] = center[k] + shrink * (point[k + 1] - center[k])
    return Plan(np.array(holds), point, pole * (point - center), np.concatenate(rise))


def climb(low: float, high: float, ticks: int, tick: float) -> FloatArray:
    """Return a smooth way up, and its two rates, (ticks, 3)."""
    time, shares = ticks * tick, np.linspace(0.0, 1.0, ticks, endpoint=False)
    paths = np.array([minimum_jerk(share) for share in shares])
    rise = (high - low) * paths / np.array([1.0, time, time**2])
    rise[:, 0] += low
    return np.asarray(rise)
