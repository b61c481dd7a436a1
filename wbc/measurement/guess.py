"""First guesses about files that nobody has described: a column map, and a robot description."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wbc.errors import LogError
from wbc.measurement.clocks import repeated_mend, restarts
from wbc.measurement.column_map import Mend, merged, parse_column_map
from wbc.measurement.column_mistakes import mirrored
from wbc.measurement.formats import open_table
from wbc.measurement.log import LogFinding
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
from wbc.measurement.schema import REPORTED, TIME, reported, today
from wbc.measurement.tables import Table


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
        lacking: what the logs lack that a diagnosis needs, and columns that are refused.
    """

    table: Mapping[str, Any]
    reasons: tuple[str, ...]
    driven: tuple[str, ...]
    targets: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    told: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    lacking: tuple[LogFinding, ...] = ()


def guess_names(
    path: str | Path, joints: Sequence[str], start: Mapping[str, Any] | None = None
) -> MapGuess:
    """Return what the names of a file's columns suggest for the joints of a robot.

    Args:
        path: a log; others like it are taken for the same.
        joints: of the robot, with one degree of freedom, from the base to the tips.
        start: a column map that the user gives; what it says is taken as it is, for example
            `{"time": {"rate": 100.0}}` of logs without a clock.

    Raises:
        LogError: a file that cannot be read, without anything like a position or velocity, or whose
            clock lost its digits.
    """
    given, table = dict(start or {}), guess_table(path, start)
    # What the motor does comes last: where the joint's own motion is there, too, it counts.
    guesses = sorted(guess_names_of(table.names), key=lambda g: g.rotor and g.quantity in MOTION)
    # A motor on a test bench is often recorded by its speed alone.
    place = next((q for q in MOTION if any(g.quantity == q for g in guesses)), "")
    if not place and not given.get("columns"):
        raise LogError(
            f"{path}: no column looks like the position or velocity of a joint. There are: "
            f"{', '.join(table.names)}. "
            + asked([g.name for g in guesses if not g.quantity], [f"{j}.position" for j in joints])
        )
    named = _joints(table, guesses, place, joints)
    whose = {owner: joint for owner, (joint, _) in named.items()}
    read = [g for g in guesses if table.holds_numbers(g.name)]
    found = channels(read, whose)
    used = {g.owner for g in read if g.name in [entry["from"] for entry in found.values()]}
    joined = {theirs: f"joint {ours}, {why}" for theirs, (ours, why) in named.items()}
    reasons = [f"{one or 'the columns'}: {told}" for one, told in joined.items() if one in used]
    columns: dict[str, Any] = {n: entry for n, entry in found.items() if entry["from"] != n}
    mapped: dict[str, Any] = {"columns": columns} if columns else {}
    mapped = merged(mapped if "time" in given else mapped | _clock(table), given)
    mapped = merged(mapped, _parts(table, mapped))
    held: dict[str, set[str]] = {joint: set() for joint in whose.values()}
    for name in (*found, *mapped.get("columns", {})):
        joint, _, quantity = today(name).rpartition(".")
        held.setdefault(joint, set()).add(quantity)
    torques = reported(columns)
    aimed = all("target_position" in held[name.rpartition(".")[0]] for name in torques)
    if aimed and mirrored([table.numbers(columns[name]["from"]) for name in torques]):
        for name in torques:
            held[name.rpartition(".")[0]] -= set(REPORTED)
        mapped = merged(mapped, {"columns": dict.fromkeys(torques, False)})
        why = "left out, magnitudes without sign; the targets make the torque"
        reasons.append(f"{', '.join(torques)}: {why}")
    driven = tuple(joint for joint, quantities in held.items() if quantities & set(REPORTED))
    followed = tuple(j for j in held if "target_position" in held[j] and j not in driven)
    if passive := ", ".join(j for j in held if driven and j not in (*driven, *followed)):
        reasons.append(f"{passive}: no torque or current, so taken for without a drive")
    unseen = tuple(joint for joint in joints if (place or "position") not in held.get(joint, ()))
    return MapGuess(mapped, tuple(reasons), driven, followed, unseen)


def _joints(
    table: Table, guesses: list[NameGuess], place: str, joints: Sequence[str]
) -> dict[str, tuple[str, str]]:
    """Return owner -> (joint, why); guesses of owners of torques alone go behind the others.

    A column of texts names the joint of its number: joint states list their joints by name, often
    in alphabetical order. What is recorded elsewhere is called otherwise; there a joint's name or
    number tells whose it is.
    """
    said = {place} if place else {g.quantity for g in guesses} - {TIME, ""}
    owners = list(dict.fromkeys(g.owner for g in guesses if g.quantity in said))
    named = joints_of(owners, joints)
    for name in table.names:
        texts = set() if not _number(name) or table.holds_numbers(name) else {*table.texts(name)}
        if len(texts) == 1 and (joint := texts.pop()) in joints:
            own = [owner for owner in owners if _number(owner) == _number(name)]
            named |= dict.fromkeys(own, (joint, f"by the cells of '{name}'"))
    others = dict.fromkeys(g.owner for g in guesses if g.quantity in REPORTED)
    more = joints_of([owner for owner in others if owner not in named], joints)
    more = {owner: one for owner, one in more.items() if one[1] != "by its place in the file"}
    guesses.sort(key=lambda guess: guess.owner in more)
    return named | more


def _number(name: str) -> str:
    return next(iter(re.findall(r"\d+", name)[::-1]), "")


def guess_table(path: str | Path, start: Mapping[str, Any] | None) -> Table:
    """Return the file that a guess is made of, with what a map says of its rows."""
    rows = parse_column_map({"rows": (start or {}).get("rows", {})}).rows
    return open_table(split_path(path)[0], rows)


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
    entries = [entry for entry in mapped.get("columns", {}).values() if isinstance(entry, dict)]
    names = [entry["from"] for entry in entries if isinstance(entry.get("from"), str)]
    names = names or [n for n in table.names if guess_name(n).quantity in MOTION]
    columns = {name: table.numbers(name) for name in names}
    return repeated_mend(time, columns, np.arange(time.size), str(table.path))
