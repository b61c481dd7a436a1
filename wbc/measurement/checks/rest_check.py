"""Joints that stand still throughout a log, such as a wrist that is held."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scipy.integrate import cumulative_trapezoid

from wbc.arrays import FloatArray
from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.log import Log
from wbc.measurement.motion.local_noise import residual_noise

_MOVES = 5.0  # times the noise, as for the suspicions about columns
_ROUNDING = 1e-6  # of the range: smaller steps come from printed digits
_WALK = 1.0 / 15.0  # mean square of a random walk over its length, its best line taken out


def resting_joints(log: Log) -> frozenset[str]:
    """Return the joints that neither their position nor their velocity shows to move.

    A position flickers by its noise and by the count of its encoder; the integral of a velocity
    strays by a constant offset and by the random walk of its noise.
    """
    return frozenset(
        joint
        for joint in log.with_quantity("position")
        if not _position_moves(log.time, log.column(f"{joint}.position"))
        and not (
            log.has(f"{joint}.velocity")
            and _velocity_moves(
                log.time, log.column(f"{joint}.velocity"), log.column(f"{joint}.position")
            )
        )
    )


def check_rest(log: Log, resting: Collection[str]) -> list[LogFinding]:
    """Return a finding for each joint that stands still, in place of those about its channels."""
    findings = []
    for joint in log.with_quantity("position"):
        if joint not in resting:
            continue
        position = log.column(f"{joint}.position")
        where = (
            f"the joint never moves (position {position[0]:g} throughout)."
            if np.ptp(position) == 0.0
            else f"the joint stands still (within {np.ptp(position):.2g} of {position.mean():.4g})."
        )
        findings.append(
            LogFinding(
                "warning",
                "constant_joint",
                f"{joint}.position",
                where,
                "This log tells nothing of the joint but a static torque: move it in another log, "
                "or lock it in the robot.",
            )
        )
    return findings


def _position_moves(time: FloatArray, position: FloatArray) -> bool:
    return bool(np.std(position) > _MOVES * _uncertainty(time, position))


def _velocity_moves(time: FloatArray, velocity: FloatArray, position: FloatArray) -> bool:
    if np.ptp(velocity) == 0.0:
        return False
    integral = cumulative_trapezoid(velocity, time, initial=0.0)
    line = np.polynomial.Polynomial.fit(time, integral, 1)
    strays = float(np.std(integral - line(time)))
    step = float(np.median(np.diff(time)))
    walk = residual_noise(time, velocity) * step * np.sqrt(_WALK * time.size)
    return bool(strays > _MOVES * np.hypot(walk, _uncertainty(time, position)))


def _uncertainty(time: FloatArray, position: FloatArray) -> float:
    """Return the standard deviation of a position's noise and of its rounding to counts."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > _ROUNDING * max(float(np.ptp(position)), 1e-300)]
    count = float(steps.min(initial=np.inf))
    rounding = count / np.sqrt(12.0) if np.isfinite(count) else 0.0
    return float(np.hypot(residual_noise(time, position), rounding))
