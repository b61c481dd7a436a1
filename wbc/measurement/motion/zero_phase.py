"""The low-pass without phase shift, and the derivatives, of evenly sampled channels."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.signal import butter, sosfilt_zi

from wbc.arrays import FloatArray

_ORDER = 2


def low_pass(values: FloatArray, cutoff: float, rate: float, order: int = _ORDER) -> FloatArray:
    """Return `values` (N, ...) low-passed forward and backward (no phase shift).

    The same call on torque, velocity and position keeps them in step, which an identification
    needs more than a faithful amplitude.

    Args:
        values: samples along the first axis.
        cutoff: [Hz] of each of the two passes of a Butterworth filter.
        rate: [Hz] sampling rate; a cutoff at or above half of it leaves the values unchanged.
        order: of each pass.
    """
    if cutoff >= 0.5 * rate or len(values) < 4 or not values.size:
        return values
    padding = min(len(values) - 1, int(3.0 * rate / cutoff))
    before = 2.0 * values[0] - values[padding:0:-1]
    after = 2.0 * values[-1] - values[-2 : -padding - 2 : -1]
    from wbc.measurement.motion.filter_loop import filter_both_ways  # loads the compiler

    longer = np.concatenate([before, values, after]).reshape(-1, values[0].size)
    filter_both_ways(*_sections(cutoff / (0.5 * rate), order), longer)
    return longer[padding : padding + len(values)].reshape(values.shape)


@lru_cache(maxsize=64)
def _sections(relative: float, order: int) -> tuple[FloatArray, FloatArray]:
    """Return a Butterworth filter's sections and their state under a steady input of one."""
    sections = butter(order, relative, output="sos")
    return np.asarray(sections), np.asarray(sosfilt_zi(sections))


def derivative(values: FloatArray, rate: float) -> FloatArray:
    """Return the time derivative of `values` (N, ...) by fourth-order central differences.

    Second-order ones shrink a 5 Hz acceleration sampled at 500 Hz by a thousandth, which shows in
    an inertia; the first and last two samples are of second order.

    Args:
        values: samples along the first axis.
        rate: [Hz].
    """
    result = np.gradient(values, 1.0 / rate, axis=0)
    if len(values) > 4:
        inner = 8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])
        result[2:-2] = inner * (rate / 12.0)
    return np.asarray(result)


def differentiate(positions: FloatArray, rate: float, model: pin.Model) -> FloatArray:
    """Return the velocity (N, nv) of configurations (N, nq) by central differences.

    Args:
        positions: pinocchio's configurations, already smoothed.
        rate: [Hz].
        model: gives the difference on joints whose configuration is no vector (free-flyer).
    """
    if model.nq == model.nv:
        return derivative(positions, rate)
    steps = np.array([pin.difference(model, a, b) for a, b in pairwise(positions)])
    inner = 0.5 * (steps[:-1] + steps[1:])
    return np.concatenate([steps[:1], inner, steps[-1:]]) * rate
