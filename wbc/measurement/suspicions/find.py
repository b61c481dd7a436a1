"""The suspicions about logs, for the ingest check and for what would compute from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from wbc.errors import LogError
from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.columns.apply import mended
from wbc.measurement.columns.map_table import Mend
from wbc.measurement.columns.mend import say_so, together
from wbc.measurement.log import Log
from wbc.measurement.suspicions.motion import (
    MotionMistake,
    motion_mistakes,
    slow_clock,
    together_likely,
)
from wbc.measurement.suspicions.readings import listed
from wbc.measurement.suspicions.torques import CERTAIN, LIKELY, Mistake, torque_mistakes
from wbc.robot import Robot

_TRUST = {"trusted": True}
_MORE = "Record more logs in which every joint moves, and give all of them together."


class SuspiciousLogError(LogError):
    """Columns of logs hold something else than their names say.

    Attributes:
        findings: the suspicions, those that are certain first.
    """

    def __init__(self, message: str, findings: Sequence[LogFinding]) -> None:
        """Keep the findings beside the message."""
        super().__init__(message)
        self.findings = tuple(findings)


def find_suspicions(logs: Sequence[Log], robot: Robot | None = None) -> list[list[LogFinding]]:
    """Return for every log what is suspected of its columns, gravest first.

    Args:
        logs: of one robot.
        robot: whose they are; without it only contradictions inside a log show.

    Returns:
        Findings of the severity `error` where the mistake is certain (probability 0.99), unless
        the column map says that the columns are trusted, and of `warning` where it is likely.
    """
    ratios = single_ratios(robot) if robot is not None else {}
    found = _shared([_of_motion(log, ratios) for log in logs])
    if robot is not None:
        clean = [
            mended(log, together(f.mend for f in own if _certain(f)))
            for log, own in zip(logs, found, strict=True)
        ]
        for mistake in torque_mistakes(robot, clean):
            for k in mistake.logs:
                found[k].append(_of_torque(mistake, logs))
    return [[_trusted(f, log) for f in own] for log, own in zip(logs, found, strict=True)]


def suspicions(robot: Robot, logs: Sequence[Log]) -> list[str]:
    """Return a sentence for each mistake that is likely; raise where one is certain.

    Args:
        robot: the robot that the user believes in.
        logs: of it.

    Raises:
        SuspiciousLogError: a column holds something else than it says. The message says which, and
            what a column map must say; that the columns are trusted, if they are right. Or no joint
            moves in any of the logs.
    """
    _require_motion(robot, logs)
    each = find_suspicions(logs, robot)
    found: dict[str, LogFinding] = {}
    where: dict[str, list[str]] = {}
    for log, own in zip(logs, each, strict=True):
        for finding in own:
            found.setdefault(finding.text, finding)
            where.setdefault(finding.text, []).append(log.source.label)
    texts = {
        text: _sentence(f, where[text] if len(where[text]) < len(logs) else [])
        for text, f in found.items()
    }
    certain = [text for text, finding in found.items() if finding.severity == "error"]
    if certain:
        mend = together(found[text].mend for text in certain)
        message = " ".join(texts[text] for text in certain)
        way = f" {found[certain[0]].way_out}" if not mend else " If so, " + say_so(mend)
        raise SuspiciousLogError(
            f"{message}{way}\nIf the columns are right, " + say_so(_TRUST),
            [found[text] for text in certain],
        )
    return [f"{text} {found[key].way_out}" for key, text in texts.items()]


def _require_motion(robot: Robot, logs: Sequence[Log]) -> None:
    """Raise where no joint moves, neither within the logs nor from one to the next."""
    names = [f"{joint}.position" for joint in robot.single_joints]
    held = [[log.column(name) for log in logs if log.has(name)] for name in names]
    known = [values for values in held if values]
    if not known or any(np.ptp(np.concatenate(values)) > 0.0 for values in known):
        return
    text = "no joint moves in these logs: every position is constant."
    way = "Record the robot in motion; if it moved, the position columns are not connected."
    finding = LogFinding("error", "constant_log", "", text, way)
    raise SuspiciousLogError(f"{logs[0].source.label}: {text} {way}", [finding])


def require_plausible_units(log: Log) -> None:
    """Check that time, position and velocity of each joint agree with each other.

    Raises:
        SuspiciousLogError: the ratio of velocity to d position / d time is that of a known
            mistake, or the time stamps are so far apart that they cannot be seconds.
    """
    certain = [f for f in (_trusted(f, log) for f in _of_motion(log, {})) if f.severity == "error"]
    if certain:
        first = certain[0]
        raise SuspiciousLogError(f"{log.source.label}: {first.text} {first.way_out}", certain)


def single_ratios(robot: Robot) -> dict[str, float]:
    """Return N of the joints that one motor drives alone (row and column of D are the identity)."""
    gears = robot.transmission
    topology = np.abs(gears.topology - np.eye(gears.size)) > 0.0
    return {
        joint: float(gears.gear_ratio[k])
        for k, joint in enumerate(gears.joints)
        if not topology[k].any() and not topology[:, k].any()
    }


def _certain(finding: LogFinding) -> bool:
    return finding.probability >= CERTAIN and bool(finding.mend)


def _trusted(finding: LogFinding, log: Log) -> LogFinding:
    if not log.source.trusted or finding.severity != "error":
        return finding
    return replace(finding, severity="warning")


def _severity(probability: float) -> str:
    return "error" if probability >= CERTAIN else "warning"


def _sentence(finding: LogFinding, labels: Sequence[str]) -> str:
    return f"{', '.join(labels)}: {finding.text}" if labels else finding.text


def _of_motion(log: Log, ratios: Mapping[str, float]) -> list[LogFinding]:
    """Return what position, velocity and clock of a log say about each other."""
    mistakes = motion_mistakes(log, ratios)
    groups: dict[str, list[MotionMistake]] = {}
    for mistake in mistakes:
        groups.setdefault(mistake.ratio.text, []).append(mistake)
    found = [_of_group(group) for group in groups.values()]
    clocks = [f for f in found if f.kind == "time_unit"]
    probability, unit = slow_clock(log)
    if not clocks and probability >= LIKELY:
        text = (
            f"the time stamps are {log.sample_time:g} s apart, too far for the motion of a robot: "
            f"the time is in {unit}?"
        )
        mend: Mend = {"time": {"unit": unit}}
        way = "If so, " + say_so(mend)
        severity = _severity(probability)
        found.append(LogFinding(severity, "time_unit", "time", text, way, mend, probability))
    return found


def _of_group(group: Sequence[MotionMistake]) -> LogFinding:
    first = group[0]
    columns = listed([f"'{one.joint}.velocity'" for one in group])
    scales = listed([f"{one.scale:.4g}" for one in group])
    text = (
        f"{columns} {'is' if len(group) == 1 else 'are'} {scales} times the derivative of the "
        f"position: {first.ratio.text}?"
    )
    mend = together(one.mend for one in group)
    probability = together_likely([one.probability for one in group])
    column = next(iter(mend.get("columns", {"time": None})))
    return LogFinding(
        _severity(probability),
        first.ratio.kind,
        column,
        text,
        "If so, " + say_so(mend),
        mend,
        probability,
    )


def _shared(found: Sequence[Sequence[LogFinding]]) -> list[list[LogFinding]]:
    """Return the findings, those that several logs show with the probability of all together."""
    shown: dict[str, list[float]] = {}
    for finding in (f for own in found for f in own):
        shown.setdefault(repr(finding.mend), []).append(finding.probability)
    likely = {mend: together_likely(each) for mend, each in shown.items()}
    return [
        [
            replace(f, severity=_severity(p), probability=p)
            for f, p in ((f, likely[repr(f.mend)]) for f in own)
        ]
        for own in found
    ]


def _of_torque(mistake: Mistake, logs: Sequence[Log]) -> LogFinding:
    way = "If so, " + say_so(mistake.mend)
    if mistake.kind == "gear_ratio":
        seen = f"{mistake.text}?"
        way = "Check gear_ratio in robot.toml, and whether the logs are of this robot."
    else:
        if mistake.others or mistake.probability < LIKELY:
            rivals = ((mistake.text, mistake.mend), *mistake.others)
            known = [f"If you know that {text}, {say_so(mend)}" for text, mend in rivals if mend]
            way = "\n".join((_MORE, *known))
        if len(mistake.logs) < len(logs):
            way = "Read these logs with a map of their own. " + way
        seen = f"{_suspected(mistake)} {_seen(mistake)}"
    return LogFinding(
        _severity(mistake.probability),
        mistake.kind,
        mistake.columns[0] if mistake.columns else "",
        seen,
        way,
        {} if mistake.others else mistake.mend,
        mistake.probability,
        mistake.mend,
    )


def _suspected(mistake: Mistake) -> str:
    """Return what may be wrong, and whether the logs can tell it."""
    logs = "one log" if len(mistake.logs) == 1 else "these logs"
    rivals = ", or ".join([mistake.text, *(text for text, _ in mistake.others)])
    if mistake.probability < LIKELY:
        return f"{logs} cannot tell whether the columns are right: perhaps {rivals}."
    cannot = f" {logs[0].upper()}{logs[1:]} cannot tell which." if mistake.others else ""
    return f"{rivals}?{cannot}"


def _seen(mistake: Mistake) -> str:
    if mistake.scale != 1.0:
        return f"The reported torque is {mistake.scale:.3g} times what the motion needs."
    then, now = 100.0 * mistake.then, 100.0 * mistake.explained
    so = "If the first is true" if mistake.others else "So read"
    return (
        f"{so}, the robot explains {then:.0f} % of the power of the reported torque, and "
        f"{now:.0f} % as it stands."
    )
