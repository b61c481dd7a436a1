"""First guesses about files that nobody has described: a column map, and a robot description."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.measurement.clocks import advancing, repeated_mend, restarts
from wbc.measurement.column_map import parse_column_map
from wbc.measurement.column_mistakes import mirrored
from wbc.measurement.filters import turns_ratio
from wbc.measurement.findings import Mend, merged
from wbc.measurement.formats import open_table
from wbc.measurement.names import (
    MOTION,
    NameGuess,
    asked,
    channels,
    guess_name,
    guess_names_of,
    joints_of,
)
from wbc.measurement.read import clock_of, split_path
from wbc.measurement.schema import LOG_UNITS, OLD_NAMES, REPORTED, TIME
from wbc.measurement.tables import Table

_DIRECT = 0.1
"""How close to 1 a ratio may be: a motor's motion is often reported in units of the joint, and then
it tells no ratio."""


@dataclass(frozen=True)
class MapGuess:
    """A guessed column map.

    Attributes:
        table: the map.
        reasons: why its lines say what they say.
        driven: joints of the robot with a column of torque or current.
        targets: joints with a column of target positions and none of torque.
        unseen: joints without a column of positions; of velocities where no joint has positions.
        told: how well the rows tell the columns of each joint, see `told_by_rows`.
    """

    table: Mapping[str, Any]
    reasons: tuple[str, ...]
    driven: tuple[str, ...]
    targets: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    told: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class RatioGuess:
    """A gear ratio from the rows of a log.

    Attributes:
        value: turns of the motor per turn of the joint, without sign.
        source: the columns that tell it.
    """

    value: float
    source: str


def guess_names(
    path: str | Path,
    joints: Sequence[str],
    rate: float | None = None,
    start: Mapping[str, Any] | None = None,
) -> MapGuess:
    """Return what the names of a file's columns suggest for the joints of a robot.

    Args:
        path: a log; others like it are taken for the same.
        joints: of the robot, with one degree of freedom, from the base to the tips.
        rate: rows per second [Hz] of logs without a clock; None where they have one.
        start: a column map that the user gives; what it says is taken as it is.

    Raises:
        LogError: a file that cannot be read, without anything like a position or velocity, or whose
            clock lost its digits.
    """
    given = dict(start or {})
    table = _table(path, given)
    # What the motor does comes last: where the joint's own motion is there, too, it counts.
    guesses = sorted(guess_names_of(table.names), key=lambda g: g.rotor and g.quantity in MOTION)
    # A motor on a test bench is often recorded by its speed alone.
    place = next((q for q in MOTION if any(g.quantity == q for g in guesses)), "")
    said = {g.quantity for g in guesses} - {TIME, ""} if not place else {place}
    owners = list(dict.fromkeys(g.owner for g in guesses if g.quantity in said))
    if not place and not given.get("columns"):
        raise LogError(
            f"{path}: no column looks like the position or velocity of a joint. There are: "
            f"{', '.join(table.names)}. "
            + asked([g.name for g in guesses if not g.quantity], [f"{j}.position" for j in joints])
        )
    named = joints_of(owners, joints)
    named |= _by_cells(table, owners, joints)
    # What is recorded elsewhere is called otherwise; a joint's name or number tells whose it is.
    others = list(dict.fromkeys(g.owner for g in guesses if g.quantity in REPORTED))
    more = joints_of([owner for owner in others if owner not in named], joints)
    more = {owner: one for owner, one in more.items() if one[1] != "by its place in the file"}
    guesses.sort(key=lambda guess: guess.owner in more)
    named |= more
    reasons = [
        f"{theirs or 'the columns'}: joint {ours}, {why}" for theirs, (ours, why) in named.items()
    ]
    whose = {owner: joint for owner, (joint, _) in named.items()}
    read = [g for g in guesses if table.holds_numbers(g.name)]
    found = channels(read, whose)
    columns: dict[str, Any] = {n: entry for n, entry in found.items() if entry["from"] != n}
    held: dict[str, set[str]] = {joint: set() for joint in whose.values()}
    for name in found:
        joint, _, quantity = name.rpartition(".")
        held[joint].add(OLD_NAMES.get(quantity, quantity))
    mapped: dict[str, Any] = {"columns": columns} if columns else {}
    if rate is not None:
        mapped["time"] = {"rate": rate}
    elif "time" not in given:
        mapped |= _clock(table)
    mapped = merged(mapped, given)
    if rate is None:
        mapped = merged(mapped, _parts(table, mapped))
    for name in mapped.get("columns", {}):
        joint, _, quantity = name.rpartition(".")
        held.setdefault(joint, set()).add(quantity)
    if refused := _unsigned(table, columns, held):
        mapped = merged(mapped, {"columns": dict.fromkeys(refused, False)})
        reasons.append(
            f"{', '.join(refused)}: left out, magnitudes without sign; the targets make the torque"
        )
    driven = tuple(joint for joint, quantities in held.items() if quantities & set(REPORTED))
    targets = [joint for joint, quantities in held.items() if "target_position" in quantities]
    followed = tuple(joint for joint in targets if joint not in driven)
    passive = [joint for joint in held if driven and joint not in (*driven, *followed)]
    if passive:
        reasons.append(f"{', '.join(passive)}: no torque or current, so taken for without a drive")
    unseen = tuple(joint for joint in joints if (place or "position") not in held.get(joint, ()))
    return MapGuess(mapped, tuple(reasons), driven, followed, unseen)


def guess_ratios(
    path: str | Path, joints: Sequence[str], start: Mapping[str, Any] | None = None
) -> Mapping[str, RatioGuess]:
    """Return the gear ratios of those joints whose motion a log holds on both sides of the gear.

    Names say which column is the motor's (`knee_motor_vel` beside `knee_vel`). Nothing is said
    where only one of the two names its unit: then the ratio may be a matter of units.

    Args:
        path: a log.
        joints: of the robot, with one degree of freedom.
        start: a column map that the user gives.
    """
    table = _table(path, start or {})
    guesses = [g for g in guess_names_of(table.names) if g.quantity in MOTION]
    own = {(g.owner, g.quantity): g for g in guesses if not g.rotor}
    named = joints_of(list(dict.fromkeys(owner for owner, _ in own)), joints)
    found: dict[str, RatioGuess] = {}
    for quantity in reversed(MOTION):
        for rotor in guesses:
            joint = own.get((rotor.owner, quantity))
            name, _ = named.get(rotor.owner, ("", ""))
            if not rotor.rotor or rotor.quantity != quantity or joint is None or not name:
                continue
            if (value := _ratio(table, rotor, joint)) and name not in found:
                source = f"from the rows: '{rotor.name}' over '{joint.name}' in the log"
                found[name] = RatioGuess(value, source)
    return found


def _by_cells(
    table: Table, owners: Sequence[str], joints: Sequence[str]
) -> dict[str, tuple[str, str]]:
    """Return owner -> (joint, why) where a column of texts names the joint of a number.

    Joint states list their joints by name, often in alphabetical order.
    """
    said: dict[str, tuple[str, str]] = {}
    for name in table.names:
        numbers = re.findall(r"\d+", name)
        cells = set() if not numbers or table.holds_numbers(name) else set(table.texts(name))
        if len(cells) == 1 and (joint := cells.pop()) in joints:
            said[numbers[-1]] = (joint, f"by the cells of '{name}'")
    found = {owner: re.findall(r"\d+", owner) for owner in owners}
    return {
        owner: said[numbers[-1]]
        for owner, numbers in found.items()
        if numbers and numbers[-1] in said
    }


def _unsigned(table: Table, columns: Mapping[str, Any], held: Mapping[str, set[str]]) -> list[str]:
    """Return the torques that have no sign, and take them from what joints with targets have."""
    names = [name for name in columns if name.endswith(tuple(f".{q}" for q in REPORTED))]
    torques = [table.numbers(columns[name]["from"]) for name in names]
    joints = {name.rpartition(".")[0] for name in names}
    if not mirrored(torques) or any("target_position" not in held[joint] for joint in joints):
        return []
    for joint in joints:
        held[joint] -= set(REPORTED)
    return names


def _table(path: str | Path, start: Mapping[str, Any]) -> Table:
    rows = parse_column_map({"rows": start.get("rows", {})}).rows
    return open_table(split_path(path)[0], rows)


def _ratio(table: Table, rotor: NameGuess, joint: NameGuess) -> float:
    """Return how many times one column follows the other; 0 where the rows do not tell."""
    if bool(rotor.unit) != bool(joint.unit):
        return 0.0
    ratio = abs(turns_ratio(*(_in_log_units(table, column) for column in (joint, rotor))))
    return float(f"{ratio:.4g}") if abs(ratio - 1.0) > _DIRECT else 0.0


def _in_log_units(table: Table, column: NameGuess) -> FloatArray:
    worth = LOG_UNITS[column.unit][1] if column.unit else 1.0
    return np.asarray(table.numbers(column.name) * worth)


def _clock(table: Table) -> dict[str, Any]:
    if not table.clocks:
        raise LogError(
            f"{table.path}: no column looks like a clock. There are: {', '.join(table.names)}. "
            "Give the rows per second: --rate HZ."
        )
    first = guess_name(table.clocks[0])
    clock: dict[str, Any] = {} if first.name == TIME else {"from": first.name}
    if first.unit and first.unit != "s":
        clock["unit"] = first.unit
    return {"time": clock} if clock else {}


def _parts(table: Table, mapped: Mapping[str, Any]) -> Mend:
    """Return what a map says of a clock that starts again, or whose stamps repeat.

    Raises:
        LogError: the clock lost its digits.
    """
    rules = parse_column_map({"time": mapped.get("time", {})})
    time = clock_of(table, rules.time)
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        for name in table.names if restarts(time).size else ():
            keys = table.texts(name)
            if not guess_name(name).quantity and np.all(keys[back] != keys[back + 1]):
                return {"rows": {"split": name}}
        return {}
    columns = {
        entry["from"]: table.numbers(entry["from"])
        for entry in mapped.get("columns", {}).values()
        if isinstance(entry, dict) and isinstance(entry.get("from"), str)
    }
    if not columns:
        columns = {n: table.numbers(n) for n in table.names if guess_name(n).quantity in MOTION}
    if np.all(np.diff(time) > 0.0):
        return {}
    advancing(time, columns, "spread", np.arange(time.size), str(table.path))  # raises if lost
    return repeated_mend(time, columns)
