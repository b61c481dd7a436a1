"""How much of a link's load is noise of the encoders, and the load without it."""

from __future__ import annotations

import numpy as np
from scipy.signal import welch

from wbc.arrays import FloatArray
from wbc.identification.records.record import Record
from wbc.measurement import low_pass

_LEAST = 1.7  # of the residual's band: a filter there hardly touches the band
_MORE = 1.4  # times the power of the noise, which loads that are believed have
_RESOLUTION = 1.0  # [Hz]
_STEEP = 6  # order of each pass of the filter


def load_bands(record: Record, noise: FloatArray) -> FloatArray:
    """Return (m,) the frequency [Hz] from which on the load of each driven joint is noise.

    Infinite where it is more than that in the whole band of the kinematics.

    Args:
        record: one log.
        noise: (N, m + b) of what the model needs, as drawn.
    """
    gears, robot = record.robot.transmission, record.robot
    load = (record.links - record.contacts)[:, robot.actuated] @ gears.topology
    length = min(len(load), max(16, int(record.rate / _RESOLUTION)))

    def power(values: FloatArray) -> tuple[FloatArray, FloatArray]:
        frequency, power = welch(values, record.rate, nperseg=length, detrend="linear", axis=0)
        return frequency, power

    frequency, signal = power(load)
    _, drawn = power(noise[:, : gears.size])
    least = _LEAST * record.bandwidth.residual
    noisy = (signal < _MORE * drawn) & (frequency >= least)[:, None]
    noisy &= (frequency < record.bandwidth.kinematics)[:, None]
    first = frequency[np.argmax(noisy, axis=0)]
    return np.where(noisy.any(axis=0), np.maximum(first, least), np.inf)


def without_noise(record: Record, load: FloatArray, joint: str, frequency: float) -> FloatArray:
    """Return the load (N, nv) by which a link behind a soft gear is driven.

    A link that swings where its load is nothing but noise makes much of it: more than the filter
    of the residual takes away, so that fits would damp the swing.

    Args:
        record: one log.
        load: (N, nv) [N m, N].
        joint: in front of the link.
        frequency: at which the link swings [rad/s].
    """
    row = record.robot.velocity_index(joint)
    cutoff = float(record.load_band[np.flatnonzero(record.robot.actuated == row)[0]])
    if frequency <= 2.0 * np.pi * cutoff:
        return load
    result = load.copy()
    result[:, row] = low_pass(load[:, row], cutoff, record.rate, _STEEP)
    return result
