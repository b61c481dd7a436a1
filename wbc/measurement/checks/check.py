"""The ingest gate: what a log is good for before anything is computed from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wbc.measurement.checks.channel_check import check_channels
from wbc.measurement.checks.clock_check import check_clock
from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.checks.log_quality import LogQuality, by_severity
from wbc.measurement.checks.log_set_check import check_set
from wbc.measurement.checks.motion_check import (
    check_ranges,
    check_rotor_positions,
    check_velocities,
    velocity_fits,
)
from wbc.measurement.checks.rest_check import check_rest, resting_joints
from wbc.measurement.checks.robot_check import check_robot
from wbc.measurement.checks.stuck_check import check_stuck
from wbc.measurement.checks.value_runs import resolution
from wbc.measurement.log import Log
from wbc.measurement.suspicions.find import find_suspicions, single_ratios
from wbc.robot import Robot


def check_log(log: Log, robot: Robot | None = None) -> LogQuality:
    """Return clock, resolution and findings of a log.

    Args:
        log: the log.
        robot: gives gears, limits and the torques that the motion needs, so that wrong columns,
            signs, sides and units show; without it only contradictions inside the log do.
    """
    return check_logs([log], robot)[0]


def check_logs(logs: Sequence[Log], robot: Robot | None = None) -> tuple[LogQuality, ...]:
    """Return the quality of each log; what speaks against using them together is in the first.

    Args:
        logs: logs said to be of one robot, at least one.
        robot: as for `check_log`.
    """
    suspected = find_suspicions(logs, robot)
    each = [_quality(log, robot, own) for log, own in zip(logs, suspected, strict=True)]
    together = check_set(logs)
    if each and together:
        first = each[0]
        findings = by_severity([*first.findings, *together])
        each[0] = replace(first, findings=findings)
    return tuple(each)


def _quality(log: Log, robot: Robot | None, suspected: Sequence[LogFinding]) -> LogQuality:
    resting = resting_joints(log)
    fits = {joint: fit for joint, fit in velocity_fits(log).items() if joint not in resting}
    ratios = single_ratios(robot) if robot is not None else {}
    named = {finding.column for finding in suspected}
    kinds = {finding.kind for finding in suspected}
    mended = {name for f in suspected for name in f.likeliest.get("columns", {})}
    velocities = [f for f in check_velocities(log, fits) if f.column not in named]
    ranges = check_ranges(log, _limits(robot) if robot is not None else {})
    lacks = check_robot(log, robot) if robot is not None else []
    findings = [
        *suspected,
        *lacks,
        *check_clock(log),
        *check_rest(log, resting),
        *check_channels(log, resting),
        *check_stuck(log, resting),
        *(velocities if "time_unit" not in kinds else ()),
        *check_rotor_positions(log, ratios),
        *(f for f in ranges if f.column not in mended and "gear_side" not in kinds),
        *_reading(log, lacks),
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


def _reading(log: Log, said: Sequence[LogFinding]) -> list[LogFinding]:
    """Return what reading the file found, without the columns of which others spoke."""
    found = [LogFinding("info", "read", "", note, "") for note in log.source.notes]
    alike: dict[str, list[str]] = {}
    for column, text in log.source.unusable.items():
        alike.setdefault(text.replace(column, "*"), []).append(column)
    for columns in alike.values():
        text = log.source.unusable[columns[0]]
        if len(columns) > 1:
            text += f" The same rows lack {', '.join(columns[1:])}."
        found.append(LogFinding("warning", "missing", ", ".join(columns), text, ""))
    told = "".join(finding.way_out for finding in said)
    ignored = [name for name in log.source.ignored if f"'{name}'" not in told]
    if ignored:
        text = f"columns that were not read: {', '.join(ignored)}."
        way_out = "If one matters, give it the name of a channel."
        found.append(LogFinding("info", "unread", "", text, way_out))
    return found


def _limits(robot: Robot) -> dict[str, tuple[float, float]]:
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    found: dict[str, tuple[float, float]] = {}
    for joint in robot.single_joints:
        row = robot.position_index(joint)
        if np.isfinite(lower[row]) and np.isfinite(upper[row]) and abs(upper[row]) < 1e6:
            found[joint] = (float(lower[row]), float(upper[row]))
    return found
