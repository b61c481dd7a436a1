"""Taking out the delay of a velocity behind its position."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.measurement.checks.motion_check import velocity_fits
from wbc.measurement.log import Log
from wbc.measurement.motion.local_polynomial import local_polynomial_operator
from wbc.measurement.motion.velocity_fit import VelocityFit

_WINDOW_SAMPLES = 11
_DEGREE = 3


def align_velocity(log: Log) -> Log:
    """Return a log whose velocities are on the clock of the positions.

    A pure delay d is shifted out, v(t + d); a first-order low-pass with the time constant T is
    undone, v + T dv/dt (local polynomials over 11 samples, so that noise above their band is not
    raised). Which of the two it is, and how long, is what `check_log` finds; joints whose velocity
    does not follow their position stay as they are.

    Returns:
        The rows for which every shifted velocity exists; the ends of the log are lost.

    Raises:
        LogError: a delay as long as the log.
    """
    fits = {j: fit for j, fit in velocity_fits(log).items() if fit.correlation > 0.9}
    shifts = [fit.delay for fit in fits.values() if not fit.filtered]
    early, late = min([0.0, *shifts]), max([0.0, *shifts])
    if late - early >= 0.5 * log.duration:
        raise LogError(
            f"{log.source.label}: a delay of {max(late, -early):g} s is as long as the log."
        )
    first, last = np.searchsorted(log.time, [log.time[0] - early, log.time[-1] - late + 1e-12])
    kept = log[int(first) : int(last)]
    return kept.with_columns(
        {f"{joint}.velocity": _aligned(log, joint, fit, kept.time) for joint, fit in fits.items()}
    )


def _aligned(log: Log, joint: str, fit: VelocityFit, time: FloatArray) -> FloatArray:
    velocity = log.column(f"{joint}.velocity")
    if not fit.filtered:
        return np.asarray(CubicSpline(log.time, velocity)(time + fit.delay))
    width = _WINDOW_SAMPLES * log.sample_time
    slope = local_polynomial_operator(log.time, width, _DEGREE, 1) @ velocity
    return np.asarray(np.interp(time, log.time, velocity + fit.delay * slope))
