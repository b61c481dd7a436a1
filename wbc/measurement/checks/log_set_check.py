"""Findings about several logs that are said to be of one robot."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.log import Log
from wbc.measurement.repeats import find_duplicates

_RATE_RATIO = 1.5
_DEGREES = 180.0 / pi


def check_set(logs: Sequence[Log]) -> list[LogFinding]:
    """Return findings about duplicates, different joints, channels, rates and scales."""
    if len(logs) < 2:
        return []
    return [*_duplicates(logs), *_joints(logs), *_rates(logs), *_scales(logs)]


def _duplicates(logs: Sequence[Log]) -> list[LogFinding]:
    return [
        LogFinding(
            "error",
            "duplicate",
            "",
            "the same data more than once: " + ", ".join(logs[k].source.label for k in group) + ".",
            "Give each recording once; a copy is no repeat, it says nothing about noise.",
        )
        for group in find_duplicates(logs)
    ]


def _joints(logs: Sequence[Log]) -> list[LogFinding]:
    first = set(logs[0].names)
    findings = []
    for log in logs[1:]:
        if set(log.joints) != set(logs[0].joints):
            findings.append(
                LogFinding(
                    "error",
                    "joints_differ",
                    "",
                    f"{log.source.label} has the joints {', '.join(log.joints)}; "
                    f"{logs[0].source.label} has {', '.join(logs[0].joints)}.",
                    "Logs given together must be of one robot.",
                )
            )
        elif set(log.names) != first:
            odd = ", ".join(sorted(first ^ set(log.names)))
            text = f"{log.source.label} and {logs[0].source.label} differ in the channels {odd}."
            way_out = "Only channels that all logs have are used together."
            findings.append(LogFinding("warning", "channels_differ", "", text, way_out))
    return findings


def _rates(logs: Sequence[Log]) -> list[LogFinding]:
    steps = [log.sample_time for log in logs]
    slow, fast = int(np.argmax(steps)), int(np.argmin(steps))
    if steps[slow] < _RATE_RATIO * steps[fast]:
        return []
    text = (
        f"{logs[slow].source.label} has {1.0 / steps[slow]:.4g} Hz, {logs[fast].source.label} "
        f"{1.0 / steps[fast]:.4g} Hz."
    )
    way_out = "Fine if they were recorded so; otherwise one clock is in another unit."
    return [LogFinding("warning", "rates_differ", "time", text, way_out)]


def _scales(logs: Sequence[Log]) -> list[LogFinding]:
    """Return findings where one log moves about 57 times as far as the others (degrees)."""
    findings = []
    for joint in logs[0].joints:
        name = f"{joint}.position"
        spans = [float(np.ptp(log.column(name))) for log in logs if log.has(name)]
        moving = [span for span in spans if span > 0.0]
        if len(moving) < 2:
            continue
        ratio = (
            max(moving) / float(np.median(moving)) if len(moving) > 2 else max(moving) / min(moving)
        )
        if ratio > 0.5 * _DEGREES and max(moving) > 2.0 * pi:
            text = f"one log spans {max(moving):.4g}, another {min(moving):.4g}."
            way_out = "If some logs are in degrees, map their unit."
            findings.append(LogFinding("warning", "scales_differ", name, text, way_out))
    return findings
