"""Findings about position, velocity and rotor position of a joint contradicting each other."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np

from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.checks.value_runs import jumps
from wbc.measurement.columns.degrees import in_degrees
from wbc.measurement.columns.map_table import Mend
from wbc.measurement.columns.mend import say_so
from wbc.measurement.log import Log
from wbc.measurement.motion.velocity_fit import VelocityFit, fit_velocity

_SCALE_ERROR = 0.05
_SCALE_TRUSTED = 0.99
_WELL_CORRELATED = 0.9
_DELAY_SAMPLES = 0.25
_MANY_TURNS = 6.0 * pi


def velocity_fits(log: Log) -> dict[str, VelocityFit]:
    """Return the relation of velocity to position of every joint that has both and moves."""
    fits: dict[str, VelocityFit] = {}
    for joint in log.with_quantity("position"):
        if not log.has(f"{joint}.velocity"):
            continue
        position = log.column(f"{joint}.position")
        if jumps(position)[0].size:
            continue
        fit = fit_velocity(log.time, position, log.column(f"{joint}.velocity"))
        if fit.moves:
            fits[joint] = fit
    return fits


def check_velocities(log: Log, fits: Mapping[str, VelocityFit]) -> list[LogFinding]:
    """Return findings about velocities that are late, mis-scaled or of something else.

    Args:
        log: the log.
        fits: from `velocity_fits`.
    """
    findings: list[LogFinding] = []
    for joint, fit in fits.items():
        name = f"{joint}.velocity"
        if abs(fit.correlation) < _WELL_CORRELATED:
            findings.append(
                LogFinding(
                    "warning",
                    "velocity_unrelated",
                    name,
                    f"its integral and the position correlate by {fit.correlation:.2f} only.",
                    "Check that both belong to one joint; leave the velocity out if it is noise.",
                )
            )
            continue
        if abs(fit.scale - 1.0) > _SCALE_ERROR and abs(fit.correlation) > _SCALE_TRUSTED:
            findings.append(_scale_finding(name, fit.scale))
        if abs(fit.delay) > max(_DELAY_SAMPLES * log.sample_time, 4.0 * fit.delay_error):
            findings.append(_delay_finding(name, fit, log.sample_time))
    return findings


def _delay_finding(name: str, fit: VelocityFit, sample_time: float) -> LogFinding:
    aligned: Mend = {"time": {"align_velocity": True}}
    left_out: Mend = {"columns": {name: False}}
    way_out = f"To take it out, {say_so(aligned)}\nTo use the position instead, {say_so(left_out)}"
    if fit.filtered:
        text = f"it has gone through a low-pass with a time constant of {1e3 * fit.delay:.1f} ms."
        return LogFinding("warning", "velocity_filtered", name, text, way_out, aligned)
    samples = abs(fit.delay) / sample_time
    side = "behind" if fit.delay > 0.0 else "ahead of"
    text = f"{abs(1e3 * fit.delay):.2f} ms ({samples:.1f} samples) {side} the position."
    return LogFinding("warning", "clock_lag", name, text, way_out, aligned)


def _scale_finding(name: str, scale: float) -> LogFinding:
    return LogFinding(
        "warning",
        "velocity_scale",
        name,
        f"it is {scale:.4g} times the derivative of the position.",
        "Check unit and scale of both; the position is usually the one to trust.",
    )


def check_rotor_positions(log: Log, ratios: Mapping[str, float]) -> list[LogFinding]:
    """Return findings about rotor positions whose ratio to the joint is not the gear's.

    Args:
        log: the log.
        ratios: gear ratio N of joints whose motor drives that joint alone.
    """
    findings: list[LogFinding] = []
    for joint in log.with_quantity("rotor_position"):
        if not log.has(f"{joint}.position") or joint not in ratios:
            continue
        position = log.column(f"{joint}.position") - log.column(f"{joint}.position").mean()
        rotor = log.column(f"{joint}.rotor_position")
        if np.ptp(position) < 1e-3:
            continue
        seen = float(position @ (rotor - rotor.mean()) / (position @ position))
        if abs(seen / ratios[joint] - 1.0) > _SCALE_ERROR:
            findings.append(
                LogFinding(
                    "error",
                    "gear_side",
                    f"{joint}.rotor_position",
                    f"it moves {seen:.4g} times as far as the joint, the gear ratio being "
                    f"{ratios[joint]:g}.",
                    "Check on which side of the gear both are, and the gear ratio of the robot.",
                )
            )
    return findings


def check_ranges(log: Log, limits: Mapping[str, tuple[float, float]]) -> list[LogFinding]:
    """Return findings about positions that a joint cannot have.

    Args:
        log: the log.
        limits: joint -> (lower, upper) position [rad or m]; joints without are judged by eye.
    """
    findings: list[LogFinding] = []
    for joint in log.with_quantity("position"):
        position = log.column(f"{joint}.position")
        low, high = float(position.min()), float(position.max())
        lower, upper = limits.get(joint, (-np.inf, np.inf))
        margin = 0.05 * (upper - lower) if np.isfinite(upper - lower) else 0.0
        seen = f"it runs from {low:.4g} to {high:.4g}"
        if low < lower - margin or high > upper + margin:
            fits = lower - margin <= np.radians(low) and np.radians(high) <= upper + margin
            mend: Mend = in_degrees(log, [joint]) if fits else {}
            way = "If so, " + say_so(mend) if fits else "State unit, side and offset in a map."
            findings.append(
                LogFinding(
                    "error" if fits else "warning",
                    "range",
                    f"{joint}.position",
                    f"{seen}, the joint allows {lower:.4g} to {upper:.4g}"
                    f"{'; read as degrees it would fit' if fits else ''}.",
                    way,
                    mend,
                )
            )
        elif high - low > _MANY_TURNS and not np.isfinite(upper - lower):
            findings.append(
                LogFinding(
                    "warning",
                    "range",
                    f"{joint}.position",
                    f"{seen}: {(high - low) / (2.0 * pi):.1f} turns if that is rad.",
                    f"If it is degrees, {say_so(in_degrees(log, [joint]))}",
                )
            )
    return findings
