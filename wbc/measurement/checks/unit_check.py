"""Units that contradict each other inside one log."""

from __future__ import annotations

from math import pi

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.measurement.log import Log
from wbc.measurement.motion.velocity_fit import fit_velocity

_TOLERANCE = 0.03
_CORRELATION = 0.95
_SLOWEST_SAMPLE_TIME = 0.3
_CHECKED_ROWS = 200_000

_SCALES: tuple[tuple[float, str, str], ...] = (
    (pi / 180.0, "the position is in degrees", '{joint}.position = {{ from = ..., unit = "deg" }}'),
    (180.0 / pi, "the velocity is in deg/s", '{joint}.velocity = {{ from = ..., unit = "deg/s" }}'),
    (30.0 / pi, "the velocity is in rpm", '{joint}.velocity = {{ from = ..., unit = "rpm" }}'),
    (0.5 / pi, "the velocity is in turns/s", '{joint}.velocity = {{ unit = "turn/s" }}'),
    (2.0 * pi, "the position is in turns", '{joint}.position = {{ from = ..., unit = "turn" }}'),
    (1e3, "the time is in ms, or the velocity in thousandths", '[time] unit = "ms"'),
    (1e6, "the time is in us", '[time] unit = "us"'),
    (1e9, "the time is in ns", '[time] unit = "ns"'),
    (1e-3, "the position is in thousandths of the velocity's unit", 'unit = "mm"'),
    (-1.0, "position and velocity have opposite signs", "{joint}.velocity = {{ sign = -1 }}"),
)
"""velocity / (d position / d time) -> what is wrong, and what a column map says about it."""


def require_plausible_units(log: Log) -> None:
    """Check that time, position and velocity of each joint agree with each other.

    Raises:
        LogError: the ratio of velocity to d position / d time is that of a known mistake, or the
            time stamps are so far apart that they cannot be seconds.
    """
    label = log.source.label
    for joint in log.with_quantity("position"):
        scale = velocity_scale(log, joint)
        if scale is None:
            continue
        for factor, text, remedy in _SCALES:
            if abs(scale / factor - 1.0) < _TOLERANCE:
                raise LogError(
                    f"{label}: '{joint}.velocity' is {scale:.4g} times the derivative of "
                    f"'{joint}.position': {text}? State it in a column map "
                    f"(--columns MAP.toml): {remedy.format(joint=joint)}."
                )
    if log.sample_time > _SLOWEST_SAMPLE_TIME:
        raise LogError(
            f"{label}: the time stamps are {log.sample_time:g} s apart, too far for the motion of "
            'a robot; if they are ms, say so in a column map: [time] unit = "ms".'
        )


def velocity_scale(log: Log, joint: str) -> float | None:
    """Return velocity / (d position / d time) of a joint, None where that cannot be told."""
    if not log.has(f"{joint}.position", f"{joint}.velocity"):
        return None
    rows = slice(0, _CHECKED_ROWS)
    time, position = log.time[rows], log.column(f"{joint}.position")[rows]
    velocity = log.column(f"{joint}.velocity")[rows]
    if time.size < 20 or np.ptp(position) < _resolution(position):
        return None
    fit = fit_velocity(time, position, velocity)
    return fit.scale if fit.moves and abs(fit.correlation) > _CORRELATION else None


def _resolution(values: FloatArray) -> float:
    """Return a range below which a channel may be noise: 20 times the median step."""
    return float(20.0 * np.median(np.abs(np.diff(values))) + 1e-9)
