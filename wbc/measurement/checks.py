"""What speaks against logs by themselves: how they were read, their clock, their velocities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wbc.errors import LogError
from wbc.measurement.clocks import CUT_FROM, GAP_STEPS, cut_at_gaps, gaps, too_short
from wbc.measurement.filters import VelocityFit
from wbc.measurement.findings import LogFinding, Mend, say_so
from wbc.measurement.log import Log

_JITTER = 0.5
_WELL_CORRELATED = 0.9
_DELAY_SAMPLES = 0.25


def check_reading(log: Log, said: Sequence[LogFinding]) -> list[LogFinding]:
    """Return what reading the file found, without the columns of which others spoke."""
    found = [LogFinding("info", "read", "", note, "") for note in log.source.notes]
    alike: dict[str, list[str]] = {}
    for column, text in log.source.unusable.items():
        alike.setdefault(text.replace(column, "*"), []).append(column)
    for columns in alike.values():
        text = log.source.unusable[columns[0]]
        if len(columns) > 1:
            text += f" The same rows lack {', '.join(columns[1:])}."
        if not any(finding.kind == "missing" for finding in said):
            found.append(LogFinding("warning", "missing", ", ".join(columns), text, ""))
    told = "".join(finding.way_out for finding in said)
    ignored = [name for name in log.source.ignored if f"'{name}'" not in told]
    if ignored:
        text = f"columns that were not read: {', '.join(ignored)}."
        way_out = "If one matters, give it the name of a channel."
        found.append(LogFinding("info", "unread", "", text, way_out))
    return found


def check_clock(log: Log) -> list[LogFinding]:
    """Return findings about gaps, jitter and length."""
    findings: list[LogFinding] = []
    steps = np.diff(log.time)
    median = float(np.median(steps))
    holes = gaps(log.time)
    if holes.size:
        text = (
            f"{holes.size} gaps longer than {GAP_STEPS:g} samples; the first at "
            f"{log.time[holes[0]]:.4f} s, the longest {1e3 * steps.max():.1f} ms."
        )
        way = (
            "Derivatives across a gap mean nothing: compare and diagnose cut the log where "
            f"more than {1e3 * CUT_FROM:g} ms are missing."
        )
        severity = "warning"
        try:
            cut_at_gaps([log])
        except LogError as cause:
            severity, text, way = "error", str(cause).removeprefix(f"{log.source.label}: "), ""
        findings.append(LogFinding(severity, "gap", "time", text, way))
    jitter = float(np.std(steps[steps <= GAP_STEPS * median]) / median)
    if jitter > _JITTER:
        text = f"the distances of the time stamps scatter by {100.0 * jitter:.0f} % of a sample."
        way = "Stamp the samples where they are measured, not where they are received."
        findings.append(LogFinding("warning", "jitter", "time", text, way))
    short = too_short(log)
    return findings if short is None else [*findings, short]


def check_velocities(log: Log, fits: Mapping[str, VelocityFit]) -> list[LogFinding]:
    """Return findings about velocities that are late or of something else.

    Args:
        log: the log.
        fits: from `velocity_fits`.
    """
    findings: list[LogFinding] = []
    for joint, fit in fits.items():
        name, late = f"{joint}.velocity", 1e3 * fit.delay
        if abs(fit.correlation) < _WELL_CORRELATED:
            text = f"its integral and the position correlate by {fit.correlation:.2f} only."
            way = "Check that both belong to one joint; leave the velocity out if it is noise."
            findings.append(LogFinding("warning", "velocity_unrelated", name, text, way))
            continue
        if abs(fit.delay) <= max(_DELAY_SAMPLES * log.sample_time, 4.0 * fit.delay_error):
            continue
        aligned: Mend = {"time": {"align_velocity": True}}
        way = f"To take it out, {say_so(aligned)}\nTo use the position instead, " + say_so(
            {"columns": {name: False}}
        )
        if fit.filtered:
            kind = "velocity_filtered"
            text = f"it has gone through a low-pass with a time constant of {late:.1f} ms."
        else:
            kind, side = "clock_lag", "behind" if late > 0.0 else "ahead of"
            samples = abs(fit.delay) / log.sample_time
            text = f"{abs(late):.2f} ms ({samples:.1f} samples) {side} the position."
        findings.append(LogFinding("warning", kind, name, text, way, aligned))
    return findings
