"""Taking out the delay of a velocity behind its position."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from wbc.errors import LogError
from wbc.measurement.log import Log
from wbc.measurement.motion_check import velocity_fits


def align_velocity(log: Log, delays: Mapping[str, float] | None = None) -> Log:
    """Return a log whose velocities are moved onto the clock of the positions.

    Args:
        log: the log.
        delays: joint -> delay of the velocity behind the position [s]; None to take those that
            `check_log` finds (joints whose velocity does not follow the position stay as they are).

    Returns:
        The rows for which every shifted velocity exists; the ends of the log are lost.

    Raises:
        LogError: a joint without velocity, or a delay as long as the log.
    """
    if delays is None:
        fits = velocity_fits(log)
        delays = {joint: fit.delay for joint, fit in fits.items() if fit.correlation > 0.9}
    if not delays:
        return log
    early, late = min(0.0, *delays.values()), max(0.0, *delays.values())
    if late - early >= 0.5 * log.duration:
        raise LogError(
            f"{log.source.label}: a delay of {max(late, -early):g} s is as long as the log."
        )
    first, last = np.searchsorted(log.time, [log.time[0] - early, log.time[-1] - late + 1e-12])
    kept = log[int(first) : int(last)]
    shifted = {
        f"{joint}.velocity": CubicSpline(log.time, log.column(f"{joint}.velocity"))(
            kept.time + delay
        )
        for joint, delay in delays.items()
    }
    return kept.with_columns(shifted)
