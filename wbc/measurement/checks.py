"""The ingest gate: what logs are good for before anything is computed from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi

import numpy as np

from wbc.measurement.channel_checks import (
    check_channels,
    check_rest,
    check_stuck,
    resolution,
    resting_joints,
)
from wbc.measurement.clocks import CUT_FROM, GAP_STEPS, find_duplicates, gaps
from wbc.measurement.filters import VelocityFit, velocity_fits
from wbc.measurement.findings import LogFinding, LogQuality, Mend, by_severity, in_degrees, say_so
from wbc.measurement.log import Log
from wbc.measurement.mistakes import find_suspicions, motionless, single_ratios
from wbc.measurement.robot_checks import check_robot
from wbc.robot import Robot

_JITTER = 0.5
_FEW_ROWS = 100
_RATE_RATIO = 1.5
_SCALE_ERROR = 0.05
_WELL_CORRELATED = 0.9
_DELAY_SAMPLES = 0.25
_MANY_TURNS = 6.0 * pi


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
    still = motionless(robot, logs) if robot is not None else None
    if still is not None:
        together.append(still)
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
        if not any(finding.kind == "missing" for finding in said):
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


def check_velocities(log: Log, fits: Mapping[str, VelocityFit]) -> list[LogFinding]:
    """Return findings about velocities that are late or of something else.

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
            turns = 2.0 * pi * round((low + high) / (4.0 * pi))
            turned = (
                turns != 0.0 and lower - margin <= low - turns and high - turns <= upper + margin
            )
            mend: Mend = in_degrees(log.columns, [joint]) if fits else {}
            said = "; read as degrees it would fit" if fits else ""
            if turned:
                mend = {"columns": {f"{joint}.position": {"offset": -turns}}}
                said = "; whole turns away it would fit"
            way = "If so, " + say_so(mend) if mend else "State unit, side and offset in a map."
            findings.append(
                LogFinding(
                    "error" if fits and not turned else "warning",
                    "range",
                    f"{joint}.position",
                    f"{seen}, the joint allows {lower:.4g} to {upper:.4g}{said}.",
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
                    f"If it is degrees, {say_so(in_degrees(log.columns, [joint]))}",
                )
            )
    return findings


def check_set(logs: Sequence[Log]) -> list[LogFinding]:
    """Return findings about duplicates, different joints, channels and rates."""
    if len(logs) < 2:
        return []
    return [*_duplicates(logs), *_joints(logs), *_rates(logs)]


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
