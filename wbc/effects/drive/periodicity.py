"""Which periods in position a torque has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray

_BINS = 16384
_CLEAR = 1e-6
LEAST_PERIODS = 1.0  # a period longer than the range of motion cannot be told from a slope


def strongest_orders(
    positions: Sequence[FloatArray], torques: Sequence[FloatArray], count: int = 3
) -> list[float]:
    """Return the angular frequencies [1/rad] at which a torque repeats with position.

    Per frequency the least squares of a sine, a cosine and a constant over all samples (a
    Lomb-Scargle periodogram with the mean free), so that neither the order of visits matters nor
    where the joint rested: sums over samples are transforms of histograms over fine bins.

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
    visits, total = np.zeros(_BINS), np.zeros(_BINS)
    for position, torque in zip(positions, torques, strict=True):
        bins = ((position - low) / length * _BINS).astype(np.int_)
        visits += np.bincount(bins, minlength=_BINS)
        total += np.bincount(bins, torque - torque.mean(), minlength=_BINS)
    power = _explained(visits, total)
    order = 2.0 * np.pi * np.arange(power.size) / length
    # Within one bin a wave must not turn by more than about half a radian.
    usable = (order >= 2.0 * np.pi * LEAST_PERIODS / span) & (order < 0.5 * _BINS / length)
    peak = usable & (power >= np.roll(power, 1)) & (power >= np.roll(power, -1))
    ranked = np.flatnonzero(peak)[np.argsort(power[peak])[::-1]]
    return [float(order[k]) for k in ranked[:count]]


def whole_number_share(order: float, told: float) -> float:
    """Return how likely the whole numbers k near an order are, at 1 / k each.

    Args:
        order: [1].
        told: distance from which on an order is told from this one; nearer ones count less the
            farther they are. Far above one it returns told / order, the integral over 1 / k.
    """
    whole = np.arange(max(np.ceil(order - told), 1.0), np.floor(order + told) + 1.0)
    near = np.maximum(1.0 - np.abs(whole - order) / told, 0.0)
    return float(np.sum(near / whole))


def _explained(visits: FloatArray, total: FloatArray) -> FloatArray:
    """Return the sum of squares (K,) that a wave of k periods over all bins (B,) explains.

    Args:
        visits: samples per bin.
        total: sum of what they hold, zero on the whole.
    """
    count = visits.size // 4
    wave, torque = np.fft.rfft(visits), np.fft.rfft(total)[:count]
    double, single, samples = wave[: 2 * count : 2], wave[:count], float(visits.sum())
    cosine, sine = single.real, -single.imag
    a = 0.5 * (samples + double.real) - cosine**2 / samples
    b = -0.5 * double.imag - cosine * sine / samples
    c = 0.5 * (samples - double.real) - sine**2 / samples
    along, across = torque.real, -torque.imag
    determinant = a * c - b**2
    found = c * along**2 - 2.0 * b * along * across + a * across**2
    # Where two of the three columns are one, the wave is no wave over these bins.
    clear = determinant > _CLEAR * samples**2
    return np.asarray(np.where(clear, found / np.where(clear, determinant, 1.0), 0.0))
