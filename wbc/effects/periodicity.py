"""Which periods in position a torque has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray

_BINS = 16384
LEAST_PERIODS = 1.0  # a period longer than the range of motion cannot be told from a slope


def strongest_orders(
    positions: Sequence[FloatArray], torques: Sequence[FloatArray], count: int = 3
) -> list[float]:
    """Return the angular frequencies [1/rad] at which a torque repeats with position.

    Each log's torque is averaged over fine bins of position and transformed; the powers of all
    logs are added, so that speed and the order of visits do not matter.

    Args:
        positions: (N,) per log [rad or m].
        torques: (N,) per log.
        count: how many peaks to return, strongest first.
    """
    low = min(float(position.min()) for position in positions)
    high = max(float(position.max()) for position in positions)
    span = high - low
    if span <= 0.0:
        return []
    # Zero padding to four times the range places peaks within an eighth of their width.
    length = 4.0 * span
    power = np.zeros(_BINS // 2 + 1)
    for position, torque in zip(positions, torques, strict=True):
        bins = ((position - low) / length * _BINS).astype(np.int_)
        total = np.bincount(bins, torque - torque.mean(), minlength=_BINS)
        power += np.abs(np.fft.rfft(total)) ** 2
    order = 2.0 * np.pi * np.arange(power.size) / length
    # Within one bin a wave must not turn by more than about half a radian.
    usable = (order >= 2.0 * np.pi * LEAST_PERIODS / span) & (order < 0.5 * _BINS / length)
    peak = usable & (power >= np.roll(power, 1)) & (power >= np.roll(power, -1))
    ranked = np.flatnonzero(peak)[np.argsort(power[peak])[::-1]]
    return [float(order[k]) for k in ranked[:count]]
