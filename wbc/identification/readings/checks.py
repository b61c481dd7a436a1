"""The ingest gate: what logs are good for before anything is computed from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.errors import LogError
from wbc.identification.readings.first_guess import turns_ratio
from wbc.identification.readings.mistakes import find_suspicions, motionless, single_ratios
from wbc.identification.readings.repeats import find_duplicates
from wbc.identification.readings.robot_checks import check_ranges, check_robot
from wbc.measurement.channel_checks import (
    check_channels,
    check_rest,
    check_stuck,
    resolution,
    resting_joints,
)
from wbc.measurement.checks import check_clock, check_reading, check_velocities
from wbc.measurement.clocks import cut_at_gaps
from wbc.measurement.filters import velocity_fits
from wbc.measurement.findings import LogFinding
from wbc.measurement.log import Log
from wbc.robot import Robot

_RATE_RATIO = 1.5
_SCALE_ERROR = 0.05


@dataclass(frozen=True)
class LogQuality:
    """Clock, resolution and findings of one log.

    Attributes:
        label: how messages call the log.
        rows: N.
        duration: [s].
        rate: 1 / median distance of the time stamps [Hz].
        jitter: standard deviation of the distances over their median.
        longest_gap: largest distance of two time stamps [s].
        resolution: channel -> quantisation step, in its unit; 0 where none shows.
        findings: in order of severity, gravest first.
    """

    label: str
    rows: int
    duration: float
    rate: float
    jitter: float
    longest_gap: float
    resolution: Mapping[str, float]
    findings: tuple[LogFinding, ...]

    @property
    def usable(self) -> bool:
        """Whether nothing was found that makes results wrong."""
        return all(finding.severity != "error" for finding in self.findings)

    def of_kind(self, kind: str) -> tuple[LogFinding, ...]:
        """Return the findings of one kind."""
        return tuple(finding for finding in self.findings if finding.kind == kind)

    def __str__(self) -> str:
        """Return a few lines for people."""
        head = (
            f"{self.label}: {self.rows} rows, {self.duration:.3f} s, {self.rate:.1f} Hz, jitter "
            f"{100.0 * self.jitter:.1f} %, longest gap {1e3 * self.longest_gap:.1f} ms"
        )
        return "\n".join([head, *(f"  {finding}" for finding in self.findings)])


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
    pieces = [_pieces(log) for log in logs]
    used = [piece for own in pieces for piece in own]
    told = iter(find_suspicions(used, robot))
    suspected = [list({f.text: f for _ in own for f in next(told)}.values()) for own in pieces]
    each = [_quality(log, robot, own) for log, own in zip(logs, suspected, strict=True)]
    together = check_set(logs)
    if robot is not None and (still := motionless(robot, used)) is not None:
        together.append(still)
    each[0] = replace(each[0], findings=_gravest_first([*each[0].findings, *together]))
    return tuple(each)


def _pieces(log: Log) -> list[Log]:
    """Return the pieces of a log that a diagnosis uses; the whole where it uses none."""
    try:
        return cut_at_gaps([log])[0]
    except LogError:
        return [log]


def _quality(log: Log, robot: Robot | None, suspected: Sequence[LogFinding]) -> LogQuality:
    resting = resting_joints(log)
    fits = {joint: fit for joint, fit in velocity_fits(log).items() if joint not in resting}
    ratios = single_ratios(robot) if robot is not None else {}
    kinds = {finding.kind for finding in suspected}
    said = {finding.column for finding in suspected}
    said |= {name for f in suspected for name in f.likeliest.get("columns", {})}
    velocities = check_velocities(log, fits) if "time_unit" not in kinds else []
    certain = any(finding.severity == "error" for finding in suspected)
    ranges = [] if kinds & {"gear_side", "counts"} else check_ranges(log, robot)
    lacks = check_robot(log, robot) if robot is not None else []
    findings = [
        *suspected,
        *lacks,
        *check_clock(log),
        *check_rest(log, resting),
        *check_channels(log, resting),
        *check_stuck(log, resting),
        *check_rotor_positions(log, ratios),
        *(f for f in velocities if f.column not in said),
        *(f for f in ranges if f.column not in said or (f.severity == "error" and not certain)),
        *check_reading(log, lacks),
    ]
    steps = np.diff(log.time)
    return LogQuality(
        label=log.source.label,
        rows=len(log),
        duration=log.duration,
        rate=1.0 / log.sample_time,
        jitter=float(np.std(steps) / np.median(steps)),
        longest_gap=float(steps.max()),
        resolution={name: resolution(values) for name, values in log.columns.items()},
        findings=_gravest_first(findings),
    )


def check_rotor_positions(log: Log, ratios: Mapping[str, float]) -> list[LogFinding]:
    """Return findings about rotor positions whose ratio to the joint is not the gear's.

    Args:
        log: the log.
        ratios: gear ratio N of joints whose motor drives that joint alone.
    """
    findings: list[LogFinding] = []
    for joint in log.with_quantity("rotor_position"):
        name = f"{joint}.rotor_position"
        if not log.has(f"{joint}.position") or joint not in ratios:
            continue
        position = log.column(f"{joint}.position")
        seen = turns_ratio(position, log.column(name))
        if np.ptp(position) < 1e-3:
            continue
        if abs(seen / ratios[joint] - 1.0) > _SCALE_ERROR:
            text = (
                f"it moves {seen:.4g} times as far as the joint, the gear ratio being "
                f"{ratios[joint]:g}."
            )
            way = "Check on which side of the gear both are, and the gear ratio of the robot."
            findings.append(LogFinding("error", "gear_side", name, text, way))
    return findings


def _gravest_first(findings: Sequence[LogFinding]) -> tuple[LogFinding, ...]:
    order = ("error", "warning", "info")
    return tuple(sorted(findings, key=lambda finding: order.index(finding.severity)))


def check_set(logs: Sequence[Log]) -> list[LogFinding]:
    """Return findings about duplicates, different joints, channels and rates."""
    findings = []
    for group in find_duplicates(logs):
        labels = ", ".join(logs[k].source.label for k in group)
        text = f"the same data more than once: {labels}."
        way = "Give each recording once; a copy is no repeat, it says nothing about noise."
        findings.append(LogFinding("error", "duplicate", "", text, way))
    first = logs[0]
    for log in logs[1:]:
        if set(log.joints) != set(first.joints):
            text = (
                f"{log.source.label} has the joints {', '.join(log.joints)}; "
                f"{first.source.label} has {', '.join(first.joints)}."
            )
            way = "Logs given together must be of one robot."
            findings.append(LogFinding("error", "joints_differ", "", text, way))
        elif odd := sorted({*first.names} ^ {*log.names}):
            text = (
                f"{log.source.label} and {first.source.label} differ in the channels "
                f"{', '.join(odd)}."
            )
            way = "Only channels that all logs have are used together."
            findings.append(LogFinding("warning", "channels_differ", "", text, way))
    slow, fast = (pick(logs, key=lambda log: log.sample_time) for pick in (max, min))
    if slow.sample_time >= _RATE_RATIO * fast.sample_time:
        text = (
            f"{slow.source.label} has {1.0 / slow.sample_time:.4g} Hz, {fast.source.label} "
            f"{1.0 / fast.sample_time:.4g} Hz."
        )
        way = "Fine if they were recorded so; otherwise one clock is in another unit."
        findings.append(LogFinding("warning", "rates_differ", "time", text, way))
    return findings
