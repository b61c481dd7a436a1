"""The ingest gate: what logs are good for before anything is computed from them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path

import numpy as np

from wbc.errors import IdentificationError, LogError
from wbc.identification.readings import mistakes
from wbc.identification.readings.kinds import columns_of, in_degrees
from wbc.identification.records.channels import placeless_joints, positions, without_position
from wbc.identification.records.contacts import moving_contact
from wbc.identification.records.drives import tells_torque
from wbc.measurement import checks as alone
from wbc.measurement.column_map import Mend, merged, say_so, together
from wbc.measurement.log import CERTAIN, Log, LogFinding, cut_at_gaps, short_label, too_short
from wbc.measurement.names import unread
from wbc.measurement.read import mended
from wbc.measurement.schema import FREE_POSE, REPORTED
from wbc.robot import Robot, state_gear
from wbc.tables import TextTable

_TORQUES = (*REPORTED, "joint_torque")
_NO_TORQUE = "Record what the drive reports; a log of positions alone can be played, not compared."
_PLACES = 400  # of a log at which contacts are looked at
_BEYOND = 3.0  # times the limit of a joint
_MANY_TURNS = 6.0 * pi


def require_robot_and_logs(robot: Robot, logs: Sequence[Log]) -> None:
    """Check the kinds of the arguments, and that the robot has gears.

    Raises:
        IdentificationError: a name in place of a robot, one log in place of a sequence, something
            else in place of a log, or a robot whose description has no gears.
    """
    if not isinstance(robot, Robot):
        way = "load it with load_robot(...)."
        raise IdentificationError(f"a robot is expected first, not {robot!r}; {way}")
    require_logs(logs)
    if not robot.transmission.size:
        raise IdentificationError(
            f"'{robot.name}' has no gears, so no joint is driven and nothing can be compared; "
            "describe each driven joint in robot.toml:\n"
            "    [gears.JOINT]\n"
            '    gear_ratio = { value = VALUE, unit = "1", source = "data sheet" }\n'
            '    rotor_inertia = { value = VALUE, unit = "kg m^2", source = "data sheet" }'
        )


def require_logs(logs: Sequence[Log]) -> None:
    """Check that logs are a sequence of logs.

    Raises:
        IdentificationError: one log in place of a sequence, or something else in place of a log.
    """
    if isinstance(logs, Log):
        raise IdentificationError("a sequence of logs is expected; give one log as [log].")
    several = isinstance(logs, Iterable) and not isinstance(logs, str | Path)
    for odd in (one for one in (logs if several else [logs]) if not isinstance(one, Log)):
        said = repr(odd if several else str(odd))
        way = "read files with load_logs([...])."
        raise IdentificationError(f"logs are expected, not {said}; {way}")


def require_readable(robot: Robot, log: Log) -> None:
    """Check that something can be said of a robot from a log, by what `check_logs` refuses, too.

    Raises:
        IdentificationError: too short a log.
        SuspiciousLogError: a position far beyond the joint's limits, or what a log lacks that the
            robot needs; the message says what to do.
    """
    if (short := too_short(log)) is not None:
        raise IdentificationError(f"{log.source.label}: {short.said}")
    for found in (*check_ranges(log, robot), *check_robot(log, robot)):
        if found.severity == "error":
            raise mistakes.SuspiciousLogError(f"{log.source.label}: {found.said}", [found])


def without_copies(logs: Sequence[Log]) -> tuple[list[Log], list[str]]:
    """Return the logs without copies of one another, and a warning for each copy.

    A copy is no second observation: it would be held out against itself.

    Raises:
        IdentificationError: one log in place of a sequence, or something else than logs.
    """
    require_logs(logs)
    copies = {copy: first for first, *others in alone.find_duplicates(logs) for copy in others}
    named = {logs[copy].source.label: logs[first].source.label for copy, first in copies.items()}
    told = "and is left out; record the motion again for a repeat."
    warnings = [f"{copy} holds the same data as {first} {told}" for copy, first in named.items()]
    return [log for k, log in enumerate(logs) if k not in copies], warnings


def check_robot(log: Log, robot: Robot) -> list[LogFinding]:
    """Return findings about what a robot has and a log lacks."""
    if unknown := _unknown_joints(log, robot):
        return [unknown]
    return [*_without_base(log, robot), *_without_torque(log, robot), *_with_holes(log, robot)]


def check_ranges(log: Log, robot: Robot | None = None) -> Iterator[LogFinding]:
    """Yield findings about positions that a joint cannot have.

    Far beyond its limits the unit must be another, and nothing can be compared.

    Args:
        log: the log.
        robot: gives the limits; a joint without any is judged by eye.
    """
    for joint in log.with_quantity("position"):
        name = f"{joint}.position"
        low, high = float(log.column(name).min()), float(log.column(name).max())
        lower, upper = -np.inf, np.inf
        if robot is not None and joint in robot.single_joints:
            row = robot.position_index(joint)
            limits = robot.model.lowerPositionLimit[row], robot.model.upperPositionLimit[row]
            if limits[0] < limits[1] and abs(limits[1]) < 1e6:
                lower, upper = map(float, limits)
        bounded = np.isfinite(upper - lower)
        spare = 0.05 * (upper - lower) if bounded else 0.0
        lowest, highest = lower - spare, upper + spare
        seen, mend = f"it runs from {low:.4g} to {high:.4g}", in_degrees(log, [joint])
        if low < lowest or high > highest:
            turns = 2.0 * pi * round((low + high) / (4.0 * pi))
            said = "; read as degrees it would fit."
            if turns and lowest <= low - turns and high - turns <= highest:
                mend = {"columns": {name: {"offset": -turns}}}
                said = "; whole turns away it would fit."
            elif not (lowest <= np.radians(low) and np.radians(high) <= highest):
                mend, said = {}, "."
            text = f"{seen}, the joint allows {lower:.4g} to {upper:.4g}{said}"
            way = "If so, " + say_so(mend) if mend else "State unit, side and offset in a map."
            if far := max(-low, high) > _BEYOND * max(-lower, upper):
                way = f"If the joint can turn further, widen its limits in the URDF. {way}"
            yield LogFinding("error" if far else "warning", "range", name, text, way, mend)
        elif high - low > _MANY_TURNS and not bounded:
            text = f"{seen}: {(high - low) / (2.0 * pi):.1f} turns if that is rad."
            way = f"If it is degrees, {say_so(mend)}"
            yield LogFinding("warning", "range", name, text, way, mend)


def _with_holes(log: Log, robot: Robot) -> Iterator[LogFinding]:
    """Yield what to do about channels that the robot needs and that hold NaN."""
    needed = [f"{joint}.position" for joint in robot.single_joints]
    for joint in robot.transmission.joints:
        quantities = ("joint_torque",) if joint in robot.sensor_only else _TORQUES
        names = [f"{joint}.{quantity}" for quantity in quantities]
        needed += [] if any(map(log.has, names)) else [*names, f"{joint}.target_position"]
    held = {name: log.source.holes[name] for name in needed if name in log.source.unusable}
    if not held:
        return
    mend: Mend = {"columns": {name: {"missing": way} for name, way in held.items()}}
    first, verb = next(iter(held)), "is" if len(held) == 1 else "are"
    rows = log.source.unusable[first].partition(". ")[0]
    way = say_so(mend, f"To {'bridge' if 'bridge' in held.values() else 'drop'} these rows, say so")
    text = f"{', '.join(held)} {verb} needed, and {rows}."
    yield LogFinding("error", "missing", first, text, way, mend)


def _unknown_joints(log: Log, robot: Robot) -> LogFinding | None:
    """Return what to do about joints without position, None where every joint has what it needs.

    A velocity is enough for a joint whose position changes nothing (see `placeless_joints`).
    """
    missing = [name for name in robot.single_joints if not log.recorded(f"{name}.position")]
    speeds = without_position(robot, log)
    placeless = placeless_joints(robot, speeds)
    missing = [name for name in missing if name not in placeless]
    if not missing:
        return None
    held = log.with_quantity("position")
    strange = [name for name in held if name not in robot.joints]
    text = f"no position of {', '.join(missing)} of '{robot.name}'; the log has those of "
    text += f"{', '.join(held) or 'no joint'}."
    way, mend = unread(log.source.ignored, [f"{name}.position" for name in missing])
    if len(mend.get("columns", {})) == len(missing):
        return LogFinding("error", "joints_unknown", "", text, way, mend)
    if len(missing) == len(strange):
        mend = {"columns": {}}
        for theirs, ours in zip(strange, missing, strict=True):
            mend["columns"] |= columns_of(theirs, log.columns, ours)
        # Motion and torques tell where the order of the names is not that of the joints.
        told = mistakes.torque_mistakes(robot, [mended(log, mend)])
        crossed = [f.mend for f, _ in told if f.kind == "exchanged" and f.probability >= CERTAIN]
        mend = merged(mend, together(crossed))
        way = "If they are the same joints in this order, " + say_so(mend)
        return LogFinding("error", "joints_unknown", "", text, way, mend)
    way += "\n" if way else ""
    way += "Give the robot of these logs, or name the columns in a column map (--columns MAP.toml)."
    if placed := ", ".join(name for name in missing if name in speeds):
        way += f" The velocity of {placed} alone is not enough: gravity or inertia there depends "
        way += "on the position."
    way += " Joints that never moved are held still by a line at the top of robot.toml:"
    return LogFinding("error", "joints_unknown", "", text, f"{way}\n    lock = {missing}", mend)


def _without_base(log: Log, robot: Robot) -> Iterator[LogFinding]:
    """Yield what to do about a free base without a pose, or else whose contacts nothing tells."""
    lacking = [n for q in FREE_POSE if robot.has_free_flyer and not log.recorded(n := f"base.{q}")]
    names = [contact.name for contact in robot.contacts]
    told = [name for name in names if name in log.contacts or log.has(f"{name}.active")]
    if lacking:
        kinds = " and ".join(dict.fromkeys(name.split(".")[1] for name in lacking))
        text = f"no {kinds} of the base of '{robot.name}', which is free: {', '.join(lacking)} "
        way = "Record where the robot is, from motion capture or a state estimator, as metres and "
        way += "as a unit quaternion (body to world). If the base is held, give the robot with its "
        way += f"fixed base. {unread(log.source.ignored, lacking)[0]}"
        yield LogFinding("error", "no_base_pose", "", f"{text}needed.", way.rstrip())
    elif robot.floating_size and names and not told:
        text = f"no force and no flag of the contacts {', '.join(names)}: only logs in which the "
        text += "robot stands on all of them can be used."
        severity = "warning"
        with suppress(LogError):  # of positions that cannot be used others speak
            places = positions(robot, log)[:: max(1, len(log) // _PLACES)]
            if moved := moving_contact(robot, places):
                severity = "error"
                text += f" In this one '{moved[0]}' moves by {moved[1]:.2g} m."
        way = f"Record {names[0]}.force.x, .y and .z [N], or {names[0]}.active, 1 while it touches "
        way += "and else 0, and so on. "
        way += unread(log.source.ignored, [f"{name}.force.z" for name in names])[0]
        yield LogFinding(severity, "no_contact_force", "", text, way.rstrip())


def _without_torque(log: Log, robot: Robot) -> Iterator[LogFinding]:
    """Yield what to do about drives whose torque nothing tells."""
    gears = robot.transmission if log.machine is None else log.machine.transmission
    if bare := [j for j in robot.sensor_only if not log.recorded(f"{j}.joint_torque")]:
        names = ", ".join(f"{joint}.joint_torque" for joint in bare)
        text = f"'{robot.name}' describes no gear of {', '.join(bare)} but a torque sensor, so "
        text += f"{names} {'is' if len(bare) == 1 else 'are'} needed."
        way = "Record it, or describe the gear in robot.toml with gear_ratio and rotor_inertia."
        yield LogFinding("error", "no_torque", "", text, way)
    gained = np.isfinite(gears.position_gain) | np.isfinite(gears.duty_gain)
    lacking, silent, aimed = [], [], []
    for k, (joint, made) in enumerate(zip(gears.joints, tells_torque(log, gears), strict=True)):
        told = [name for name in _TORQUES if log.recorded(f"{joint}.{name}")]
        aims = log.recorded(f"{joint}.target_position")
        if joint in bare:
            continue
        if told == ["current"] and not np.isfinite(gears.torque_constant[k]):
            silent.append(joint)
        elif not (told or made or (aims and gained[k])):
            lacking.append(joint)
            aimed += [joint] if aims else []
    if lacking and aimed == lacking:
        text = f"targets and no torque of {', '.join(lacking)}, and the robot states no gains of "
        ways = "\n".join(state_gear(joint, "kp", "kd") for joint in lacking)
        way = f"State them (of drives that set the voltage: duty_gain instead of kp and kd): {ways}"
        yield LogFinding("error", "no_drive_gains", "", f"{text}their position drives.", way)
    elif lacking:
        text = f"no torque of {', '.join(lacking)}: one of rotor_torque, motor_torque, current and "
        text += "joint_torque is needed, or target_position and the drive's gains kp and kd."
        sought = [f"{joint}.{q}" for joint in lacking for q in ("motor_torque", *REPORTED)]
        way, mend = unread(log.source.ignored, sought)
        if len(mend.get("columns", {})) < len(lacking):
            way = f"{_NO_TORQUE} {way}".rstrip()
        yield LogFinding("error", "no_torque", "", text, way, mend)
    if silent:
        text = f"the log gives currents of {', '.join(silent)}, and the robot no torque constant."
        way = "State it: " + "\n".join(state_gear(joint, "torque_constant") for joint in silent)
        yield LogFinding("error", "no_torque_constant", "", text, way)


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
        return "\n".join([str(clock_rows([self])), *(f"  {finding}" for finding in self.findings)])


def clock_rows(qualities: Sequence[LogQuality]) -> TextTable:
    """Return length and clock of every log."""
    cells = []
    for q in qualities:
        clock = f"{q.rate:.1f}", f"{100.0 * q.jitter:.1f} %", f"{1e3 * q.longest_gap:.1f} ms"
        cells.append((short_label(q.label), str(q.rows), f"{q.duration:.3f}", *clock))
    return TextTable.of("log|>rows|>length [s]|>rate [Hz]|>jitter|>longest gap", cells)


def check_log(log: Log, robot: Robot | None = None) -> LogQuality:
    """Return clock, resolution and findings of a log; as `check_logs`."""
    return check_logs([log], robot)[0]


def check_logs(logs: Sequence[Log], robot: Robot | None = None) -> tuple[LogQuality, ...]:
    """Return the quality of each log; what speaks against using them together is in the first.

    Args:
        logs: logs said to be of one robot, at least one.
        robot: gives gears, limits and the torques that the motion needs, so that wrong columns,
            signs, sides and units show; without it only contradictions inside a log do.
    """
    pieces = []
    for log in logs:
        pieces.append([log])
        with suppress(LogError):  # a diagnosis uses no part of it
            pieces[-1] = cut_at_gaps([log])[0]
    used = [piece for own in pieces for piece in own]
    told = iter(mistakes.find_suspicions(used, robot))
    suspected = [list({f.text: f for _ in own for f in next(told)}.values()) for own in pieces]
    each = [_quality(log, robot, own) for log, own in zip(logs, suspected, strict=True)]
    still = None if robot is None else mistakes.motionless(robot, used)
    more = [*alone.check_set(logs), *([still] if still else [])]
    each[0] = replace(each[0], findings=_gravest_first([*each[0].findings, *more]))
    return tuple(each)


def _quality(log: Log, robot: Robot | None, suspected: Sequence[LogFinding]) -> LogQuality:
    said = {finding.column for finding in suspected}
    said |= {name for f in suspected for name in f.likeliest.get("columns", {})}
    certain = any(finding.severity == "error" for finding in suspected)
    sided = any(finding.kind in ("gear_side", "counts") for finding in suspected)
    ranges = [] if sided else check_ranges(log, robot)
    lacks = check_robot(log, robot) if robot is not None else []
    findings = [
        *suspected,
        *lacks,
        *alone.check_alone(log, said),
        *(f for f in ranges if f.column not in said or (f.severity == "error" and not certain)),
        *alone.check_reading(log, lacks),
    ]
    steps = np.diff(log.time)
    jitter, longest = float(np.std(steps) / np.median(steps)), float(steps.max())
    fine = {name: alone.resolution(values) for name, values in log.columns.items()}
    clock = log.duration, 1.0 / log.sample_time, jitter, longest
    return LogQuality(log.source.label, len(log), *clock, fine, _gravest_first(findings))


def _gravest_first(findings: Sequence[LogFinding]) -> tuple[LogFinding, ...]:
    order = ("error", "warning", "info")
    return tuple(sorted(findings, key=lambda finding: order.index(finding.severity)))
