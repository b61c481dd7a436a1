"""Findings about the clock of a log."""

from __future__ import annotations

import numpy as np

from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.gaps import CUT_FROM, GAP_STEPS, gaps
from wbc.measurement.log import Log

_JITTER = 0.5
_FEW_ROWS = 100


def check_clock(log: Log) -> list[LogFinding]:
    """Return findings about gaps, jitter, length and decimation."""
    findings: list[LogFinding] = []
    steps = np.diff(log.time)
    median = float(np.median(steps))
    holes = gaps(log.time)
    if holes.size:
        first = int(holes[0])
        findings.append(
            LogFinding(
                "warning",
                "gap",
                "time",
                f"{holes.size} gaps longer than {GAP_STEPS:g} samples; the first at "
                f"{log.time[first]:.4f} s, the longest {1e3 * steps.max():.1f} ms.",
                "Derivatives across a gap mean nothing: compare and diagnose cut the log where "
                f"more than {1e3 * CUT_FROM:g} ms are missing.",
            )
        )
    jitter = float(np.std(steps[steps <= GAP_STEPS * median]) / median)
    if jitter > _JITTER:
        findings.append(
            LogFinding(
                "warning",
                "jitter",
                "time",
                f"the distances of the time stamps scatter by {100.0 * jitter:.0f} % of a sample.",
                "Stamp the samples where they are measured, not where they are received.",
            )
        )
    if len(log) < _FEW_ROWS:
        findings.append(
            LogFinding(
                "warning",
                "short",
                "",
                f"only {len(log)} rows.",
                "A few seconds at 100 Hz or more are needed to identify anything.",
            )
        )
    if log.source.decimation > 1:
        findings.append(
            LogFinding(
                "info",
                "decimated",
                "",
                f"one row of {log.source.decimation} was kept, after an anti-alias filter.",
                "Raise max_rows to keep more.",
            )
        )
    return findings
