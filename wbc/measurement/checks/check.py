"""The ingest gate: what a log is good for before anything is computed from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.measurement.checks.channel_check import check_channels
from wbc.measurement.checks.clock_check import check_clock
from wbc.measurement.checks.finding import Finding
from wbc.measurement.checks.log_quality import LogQuality, by_severity
from wbc.measurement.checks.log_set_check import check_set
from wbc.measurement.checks.motion_check import (
    check_ranges,
    check_rotor_positions,
    check_velocities,
    velocity_fits,
)
from wbc.measurement.checks.stuck_check import check_stuck
from wbc.measurement.checks.value_runs import resolution
from wbc.measurement.log import Log
from wbc.robot import Robot


def check_log(log: Log, robot: Robot | None = None) -> LogQuality:
    """Return clock, resolution and findings of a log.

    Args:
        log: the log.
        robot: gives gear ratios and joint limits, so that a wrong side of the gear and degrees
            show; without it only contradictions inside the log do.
    """
    ratios = _serial_ratios(robot) if robot is not None else {}
    fits = velocity_fits(log)
    findings = [
        *check_clock(log),
        *check_channels(log),
        *check_stuck(log),
        *check_velocities(log, fits, ratios),
        *check_rotor_positions(log, ratios),
        *check_ranges(log, _limits(robot) if robot is not None else {}),
        *_unread(log),
    ]
    steps = np.diff(log.time)
    return LogQuality(
        label=log.source.label,
        rows=len(log),
        duration=log.duration,
        rate=1.0 / log.sample_time,
        jitter=float(np.std(steps) / np.median(steps)),
        longest_gap=float(steps.max()),
        velocity_delay={joint: fit.delay for joint, fit in fits.items()},
        velocity_scale={joint: fit.scale for joint, fit in fits.items()},
        resolution={name: resolution(values) for name, values in log.columns.items()},
        findings=by_severity(findings),
    )


def check_logs(logs: Sequence[Log], robot: Robot | None = None) -> tuple[LogQuality, ...]:
    """Return the quality of each log; what speaks against using them together is in the first.

    Args:
        logs: logs said to be of one robot, at least one.
        robot: as for `check_log`.
    """
    each = [check_log(log, robot) for log in logs]
    together = check_set(logs)
    if each and together:
        first = each[0]
        findings = by_severity([*first.findings, *together])
        each[0] = LogQuality(**{**vars(first), "findings": findings})
    return tuple(each)


def _unread(log: Log) -> list[Finding]:
    if not log.source.ignored:
        return []
    text = f"columns that were not read: {', '.join(log.source.ignored)}."
    return [Finding("info", "unread", "", text, "Map them if they matter (--columns MAP.toml).")]


def _serial_ratios(robot: Robot) -> dict[str, float]:
    """Return N of the joints that one motor drives alone (row and column of D are the identity)."""
    gears = robot.transmission
    topology = np.abs(gears.topology - np.eye(gears.size)) > 0.0
    return {
        joint: float(gears.gear_ratio[k])
        for k, joint in enumerate(gears.joints)
        if not topology[k].any() and not topology[:, k].any()
    }


def _limits(robot: Robot) -> dict[str, tuple[float, float]]:
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    found: dict[str, tuple[float, float]] = {}
    for joint in robot.single_joints:
        row = robot.position_index(joint)
        if np.isfinite(lower[row]) and np.isfinite(upper[row]) and abs(upper[row]) < 1e6:
            found[joint] = (float(lower[row]), float(upper[row]))
    return found
