"""A column map for files that nobody has described: a guess, every line with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wbc.errors import LogError
from wbc.measurement.checks.finding import LogFinding
from wbc.measurement.checks.robot_check import check_robot
from wbc.measurement.columns.column_map import parse_column_map
from wbc.measurement.columns.map_table import merged
from wbc.measurement.columns.mend import say_so
from wbc.measurement.formats.open_table import open_table
from wbc.measurement.formats.table import Table
from wbc.measurement.guessing.names import NameGuess, guess_name, joints_of
from wbc.measurement.load import read_logs
from wbc.measurement.log import Log
from wbc.measurement.schema import OLD_NAMES, TIME
from wbc.measurement.suspicions.find import find_suspicions, single_ratios
from wbc.measurement.suspicions.matching import match_joints
from wbc.measurement.suspicions.torques import LIKELY
from wbc.measurement.torque import REPORTED
from wbc.robot import Robot

_LOGS = 4  # of a file that are looked at: a guess needs no more
_ROUNDS = 5  # of corrections, one upon another
_PLACES = ("position", "velocity")  # by which a file tells whose its columns are
_OF_MOTION = ("time_unit", "velocity_unit", "velocity_sign", "gear_side", "degrees")


@dataclass(frozen=True)
class MapGuess:
    """A guessed column map.

    Attributes:
        table: the map.
        reasons: why its lines say what they say.
        driven: joints of the robot with a column of torque or current.
        targets: joints with a column of target positions and none of torque.
        unseen: joints without a column of positions; of velocities where no joint has positions.
    """

    table: Mapping[str, Any]
    reasons: tuple[str, ...]
    driven: tuple[str, ...]
    targets: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()


def guess_names(path: str | Path, joints: Sequence[str], rate: float | None = None) -> MapGuess:
    """Return what the names of a file's columns suggest for the joints of a robot.

    Args:
        path: a log; others like it are taken for the same.
        joints: of the robot, with one degree of freedom.
        rate: rows per second [Hz] of logs without a clock; None where they have one.

    Raises:
        LogError: a file that cannot be read, or without anything like a position or velocity.
    """
    table = open_table(Path(path))
    # What the motor does comes last: where the joint's own motion is there, too, it counts.
    guesses = sorted(map(guess_name, table.names), key=lambda g: g.rotor and g.quantity in _PLACES)
    # A motor on a test bench is often recorded by its speed alone.
    place = next((q for q in _PLACES if any(g.quantity == q for g in guesses)), "")
    owners = list(dict.fromkeys(g.owner for g in guesses if g.quantity == place))
    if not place:
        raise LogError(
            f"{path}: no column looks like the position or velocity of a joint. There are: "
            f"{', '.join(table.names)}. Put the name of one in place of COLUMN, and "
            + say_so({"columns": {f"{name}.position": {"from": "COLUMN"} for name in joints[:1]}})
        )
    named, by_name = joints_of(owners, joints)
    reasons = [
        f"{theirs or 'the columns'}: joint {ours}, "
        + ("by its name" if theirs in by_name else "by its place in the file")
        for theirs, ours in named.items()
    ]
    columns: dict[str, Any] = {}
    for guess in guesses:
        if guess.owner not in named or guess.quantity in ("", TIME):
            continue
        target = f"{named[guess.owner]}.{guess.quantity}"
        if target in columns or target == guess.name:
            continue
        columns[target] = {"from": guess.name, **({"unit": guess.unit} if guess.unit else {})}
    mapped: dict[str, Any] = {"columns": columns} if columns else {}
    if rate is None:
        mapped |= _clock(guesses, table)
        mapped |= _parts(table, mapped)
    else:
        mapped["time"] = {"rate": rate}
    held = {
        ours: {OLD_NAMES.get(g.quantity, g.quantity) for g in guesses if g.owner == theirs}
        for theirs, ours in named.items()
    }
    driven = tuple(joint for joint, quantities in held.items() if quantities & set(REPORTED))
    targets = tuple(
        joint
        for joint, quantities in held.items()
        if joint not in driven and "target_position" in quantities
    )
    unseen = tuple(joint for joint in joints if place not in held.get(joint, ()))
    return MapGuess(mapped, tuple(reasons), driven, targets, unseen)


def guess_map(robot: Robot, paths: Sequence[str | Path], start: MapGuess) -> MapGuess:
    """Return a guess corrected by what the rows say against the robot.

    Joints by motion and torque, units by derivative, sides by ratio, signs by gravity.

    Args:
        robot: whose logs they are, as far as it is known.
        paths: the logs.
        start: from the names.
    """
    table, reasons = dict(start.table), list(start.reasons)
    unsure = any("by its place" in reason for reason in reasons) and len(start.driven) > 1
    for _ in range(_ROUNDS):
        logs = _read(paths, table, robot)
        doubts = [
            finding
            for finding in find_suspicions(logs, robot)[0]
            if finding.likeliest and finding.probability >= LIKELY and not _denied(finding, table)
        ]
        # What contradicts itself within a log comes before what the torques say.
        doubts = [f for f in doubts if f.kind in _OF_MOTION] or doubts
        moved = (
            {}
            if not unsure or any(f.kind in _OF_MOTION for f in doubts)
            else (_matched(robot, logs[0], start.driven))
        )
        if moved:
            table = merged(table, {"columns": moved})
            reasons.append("the order of the joints was changed: so the torques follow the motion")
        elif doubts:
            for finding in doubts:
                table = merged(table, finding.likeliest)
                reasons.append(f"{finding.text} (probability {finding.probability:.2f})")
        else:
            break
        unsure = unsure and not moved
    return MapGuess(table, tuple(reasons), start.driven, start.targets, start.unseen)


def not_found(robot: Robot, path: str | Path, table: Mapping[str, Any]) -> list[LogFinding]:
    """Return what a log lacks that the diagnosis of a robot needs, with the way to add it.

    Args:
        robot: whose log it is.
        path: the log; others like it are taken for the same.
        table: the map that reads it.
    """
    return check_robot(_read([path], table, robot)[0], robot)


def _denied(finding: LogFinding, table: Mapping[str, Any]) -> bool:
    """Whether the names say what a finding doubts: angles in rad."""
    entries = [
        table.get("columns", {}).get(name, {}) for name in finding.likeliest.get("columns", {})
    ]
    return finding.kind == "degrees" and any(entry.get("unit") == "rad" for entry in entries)


def _read(paths: Sequence[str | Path], table: Mapping[str, Any], robot: Robot) -> list[Log]:
    rules = parse_column_map(table, "", single_ratios(robot))
    return list(read_logs(paths[:_LOGS], rules))[:_LOGS]


def _matched(robot: Robot, log: Log, joints: Sequence[str]) -> dict[str, Any]:
    """Return the columns that must be exchanged, if the rows tell it."""
    order, sure = match_joints(robot, log, joints, joints)
    if not sure:
        return {}
    return {
        f"{ours}.{name.removeprefix(theirs + '.')}": {"from": name}
        for ours, theirs in order.items()
        if ours != theirs
        for name in log.columns
        if name.startswith(f"{theirs}.")
    }


def _clock(guesses: Sequence[NameGuess], table: Table) -> dict[str, Any]:
    times = [g for g in guesses if g.quantity == TIME or g.name == TIME]
    if not times:
        raise LogError(
            f"{table.path}: no column looks like a clock. There are: {', '.join(table.names)}. "
            "Give the rows per second: --rate HZ."
        )
    first = times[0]
    clock: dict[str, Any] = {} if first.name == TIME else {"from": first.name}
    if first.unit and first.unit != "s":
        clock["unit"] = first.unit
    return {"time": clock} if clock else {}


def _parts(table: Table, mapped: Mapping[str, Any]) -> dict[str, Any]:
    """Return the section [rows] for a file whose clock starts again where a text changes."""
    clock = mapped.get("time", {}).get("from", TIME)
    time = np.concatenate([chunk[clock] for chunk in table.chunks([clock], [])])
    if np.all(np.diff(time) > 0.0):
        return {}
    back = np.flatnonzero(np.diff(time) <= 0.0)
    for name in table.names:
        if guess_name(name).quantity:
            continue
        try:
            keys = np.concatenate([chunk[name] for chunk in table.chunks([], [name])])
        except LogError:
            continue
        if np.all(keys[back] != keys[back + 1]):
            return {"rows": {"split": name}}
    return {"time": {**mapped.get("time", {}), "repeated": "first"}}
