"""Findings about single channels: saturation, wraps, resolution, dead sensors."""

from __future__ import annotations

from collections.abc import Collection
from math import log2, pi

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.checks.value_runs import jumps, plateau, resolution
from wbc.measurement.columns.map_table import Mend
from wbc.measurement.columns.mend import say_so
from wbc.measurement.gaps import gaps
from wbc.measurement.log import Log
from wbc.measurement.schema import split_column

_SATURATED_SHARE = 0.005
_COARSE_SHARE = 0.1
_FULL_DUTY = 0.995
_ACTUATION = ("rotor_torque", "motor_torque", "current", "duty")
_MOTION = ("position", "velocity", "rotor_position")
_MEASURED = (*_MOTION, *_ACTUATION, "joint_torque")


def check_channels(log: Log, resting: Collection[str] = ()) -> list[LogFinding]:
    """Return findings about every measured channel of the joints.

    Args:
        log: the log.
        resting: joints that stand still, whose motion is not judged.
    """
    findings: list[LogFinding] = []
    holes = gaps(log.time)
    for name, values in log.columns.items():
        parts = split_column(name)
        if parts is None or parts[1] not in _MEASURED:
            continue
        if parts[0] in resting and parts[1] in _MOTION:
            continue
        if values[0] == values[-1] and np.ptp(values) == 0.0:
            findings.append(_constant(name, float(values[0]), parts[1]))
            continue
        if parts[1] in _ACTUATION:
            findings += _saturation(log, parts[0], name)
        if parts[1] in ("position", "rotor_position"):
            findings += _wraps(name, values, holes)
        findings += _coarse(name, values)
    return findings


def _constant(name: str, value: float, quantity: str) -> LogFinding:
    if quantity == "position":
        text = f"{value:g} throughout, while the velocity changes."
        return LogFinding("warning", "constant_joint", name, text, "The channel is not connected.")
    severity = "info" if quantity in _ACTUATION and value == 0.0 else "warning"
    text = "zero throughout." if value == 0.0 else f"{value:g} throughout."
    way_out = "Fine for an unpowered joint; otherwise the channel is not connected."
    return LogFinding(severity, "constant_channel", name, text, way_out)


def _saturation(log: Log, joint: str, name: str) -> list[LogFinding]:
    values = log.column(name)
    name_of_position = f"{joint}.position"
    # A duty of one is the limit by definition, whether the joint moves or not.
    full = name.endswith(".duty") and float(np.abs(values).max()) >= _FULL_DUTY
    known = log.has(name_of_position) and not full
    position = log.column(name_of_position) if known else None
    low, high, share, runs = plateau(values, position)
    if share < _SATURATED_SHARE or (runs < 3 and not full):
        return []
    return [
        LogFinding(
            "warning",
            "saturation",
            name,
            f"{100.0 * share:.1f} % of the samples sit at an extreme ({low:g} or {high:g}).",
            "The drive or its sensor is at its limit: what it really did there is unknown. Leave "
            "those times out, or excite less.",
        )
    ]


def _wraps(name: str, values: FloatArray, holes: IntArray) -> list[LogFinding]:
    rows, sizes = jumps(values)
    # Where samples are missing a joint that moves on jumps without any wrap.
    sampled = ~np.isin(rows, holes)
    rows, sizes = rows[sampled], sizes[sampled]
    if not rows.size or np.ptp(np.abs(sizes)) > 0.1 * np.abs(sizes).mean():
        return []
    size = float(np.abs(sizes).mean())
    period, text = _known_period(size)
    mend: Mend = {"columns": {name: {"unwrap": period}}}
    return [
        LogFinding(
            "error",
            "wrap",
            name,
            f"{rows.size} jumps of {size:.6g} ({text}), the first at row {int(rows[0]) + 1}.",
            "If so, " + say_so(mend),
            mend,
        )
    ]


def _known_period(size: float) -> tuple[float, str]:
    """Return (period, name) of the wrap that a jump of `size` shows."""
    # The joint goes on moving during the jump, so the size is only close to the period.
    for period, name in ((2.0 * pi, "one turn"), (pi, "half a turn"), (360.0, "360 deg")):
        if abs(size / period - 1.0) < 0.05:
            return period, name
    bits = round(log2(size)) if size > 8.0 else 0
    if bits and abs(size / 2.0**bits - 1.0) < 0.05:
        return 2.0**bits, f"2^{bits} encoder counts"
    return size, "an unsigned encoder, or a counter that was reset"


def _coarse(name: str, values: FloatArray) -> list[LogFinding]:
    step = resolution(values)
    spread = float(np.std(values))
    if step <= _COARSE_SHARE * spread:
        return []
    return [
        LogFinding(
            "warning",
            "coarse",
            name,
            f"the resolution {step:.4g} is {100.0 * step / spread:.0f} % of the signal's spread.",
            "Excite more, or read the value with more bits.",
        )
    ]
