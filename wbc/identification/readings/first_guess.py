"""First guesses about files that nobody has described: a column map, and a robot description."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wbc.errors import LogError, RobotError
from wbc.files import write_text
from wbc.identification.readings.checks import check_robot
from wbc.identification.readings.mistakes import find_suspicions, single_ratios, told_by_rows
from wbc.measurement.clocks import repeated_mend, restarts
from wbc.measurement.column_map import Mend, merged, parse_column_map
from wbc.measurement.column_mistakes import mirrored
from wbc.measurement.formats import open_table
from wbc.measurement.log import LIKELY, LogFinding
from wbc.measurement.names import (
    MOTION,
    NameGuess,
    asked,
    channels,
    guess_name,
    guess_names_of,
    joints_of,
)
from wbc.measurement.read import clock_of, load_logs, split_path
from wbc.measurement.schema import LOG_UNITS, REPORTED, TIME, reported, today
from wbc.measurement.tables import Table
from wbc.robot import Robot
from wbc.robot.model_file import driven_joints, read_model, xml_root

_LOGS = 4  # of a file that are looked at: a guess needs no more
_ROUNDS = 6  # of corrections, one upon another
_LACKS = ("joints_unknown", "no_torque")  # what is not there is not guessed twice
# How close to 1 a ratio may be: a motor's motion is often reported in units of the joint, and then
# it tells no ratio.
_DIRECT = 0.1
_OTHERWISE = 0.01  # of the power of a motor's motion that its joint's may leave
_KP, _KD = 20.0, 0.5  # gains of a small position drive: a start that has to be replaced
_GUESS = "guess: not in the model file; look it up"


Ratio: TypeAlias = tuple[float, str]
"""Turns of the motor per turn of the joint, without sign, and the columns that tell it."""


@dataclass(frozen=True)
class MapGuess:
    """A guessed column map.

    Attributes:
        table: the map.
        reasons: why its lines say what they say.
        driven: joints of the robot with a column of torque or current.
        targets: joints with a column of target positions and none of torque.
        unseen: joints without a column of positions; of velocities where no joint has positions.
        ratios: gear ratios that motion on both sides of a gear tells.
        told: how well the rows tell the columns of each joint, see `told_by_rows`.
        lacking: what the logs lack that a diagnosis needs, and columns that are refused.
    """

    table: Mapping[str, Any]
    reasons: tuple[str, ...]
    driven: tuple[str, ...]
    targets: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    ratios: Mapping[str, Ratio] = field(default_factory=dict)
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
    given = dict(start or {})
    table = open_table(split_path(path)[0], parse_column_map({"rows": given.get("rows", {})}).rows)
    # What the motor does comes last: where the joint's own motion is there, too, it counts.
    guesses = sorted(guess_names_of(table.names), key=lambda g: g.rotor and g.quantity in MOTION)
    # A motor on a test bench is often recorded by its speed alone.
    place = next((q for q in MOTION if any(g.quantity == q for g in guesses)), "")
    if not place and not given.get("columns"):
        strange = [guess.name for guess in guesses if not guess.quantity]
        lacks = "no column looks like the position or velocity of a joint. There are: "
        lacks += f"{', '.join(table.names)}."
        raise LogError(f"{path}: {lacks} {asked(strange, [f'{j}.position' for j in joints])}")
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
    ratios = _ratios(table, read, whose)
    return MapGuess(mapped, tuple(reasons), driven, followed, unseen, ratios)


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
        texts = set() if not _counted(name) or table.holds_numbers(name) else {*table.texts(name)}
        if len(texts) == 1 and (joint := texts.pop()) in joints:
            own = [owner for owner in owners if _counted(owner) == _counted(name)]
            named |= dict.fromkeys(own, (joint, f"by the cells of '{name}'"))
    others = dict.fromkeys(g.owner for g in guesses if g.quantity in REPORTED)
    more = joints_of([owner for owner in others if owner not in named], joints)
    more = {owner: one for owner, one in more.items() if one[1] != "by its place in the file"}
    guesses.sort(key=lambda guess: guess.owner in more)
    return named | more


def _counted(name: str) -> str:
    return next(iter(re.findall(r"\d+", name)[::-1]), "")


def _ratios(
    table: Table, guesses: Sequence[NameGuess], whose: Mapping[str, str]
) -> dict[str, Ratio]:
    """Return the gear ratios of those joints whose motion a file holds on both sides of the gear.

    Names say which column is the motor's (`knee_motor_vel` beside `knee_vel`). Nothing is said
    where only one of the two names its unit: then the ratio may be a matter of units.

    Args:
        table: the file.
        guesses: of its columns that hold numbers.
        whose: owner -> joint.
    """
    moving = [g for g in guesses if g.quantity in MOTION and g.owner in whose]
    own = {(g.owner, g.quantity): g for g in moving if not g.rotor}
    found: dict[str, Ratio] = {}
    motors = sorted((g for g in moving if g.rotor), key=lambda g: g.quantity, reverse=True)
    for rotor in motors:  # by velocities first
        joint, name = own.get((rotor.owner, rotor.quantity)), whose[rotor.owner]
        if not joint or name in found or bool(rotor.unit) != bool(joint.unit):
            continue
        worth = [LOG_UNITS[g.unit or "1"][1] for g in (joint, rotor)]
        both = np.stack([table.numbers(joint.name), table.numbers(rotor.name)])
        both = both[:, np.isfinite(both).all(axis=0)] * np.array(worth)[:, None]
        if both.shape[1] < 3:
            continue
        (turned, shared), (_, driven) = np.cov(both)
        # Play, flexible gears and noise leave little of the motor's motion. The ratio is read from
        # the motor, whose encoder turns further and whose noise counts the least.
        if shared and shared**2 >= (1.0 - _OTHERWISE) * turned * driven:
            ratio = float(f"{abs(driven / shared):.4g}")
            if abs(ratio - 1.0) > _DIRECT:
                found[name] = ratio, f"from the rows: '{rotor.name}' over '{joint.name}' in the log"
    return found


def _clock(table: Table) -> dict[str, Any]:
    if not table.clocks:
        held = f"no column looks like a clock. There are: {', '.join(table.names)}."
        raise LogError(f"{table.path}: {held} Give the rows per second: --rate HZ.")
    first = guess_name(table.clocks[0])
    clock = {} if first.name == TIME else {"from": first.name}
    clock |= {"unit": first.unit} if first.unit not in ("", "s") else {}
    return {"time": clock} if clock else {}


def _parts(table: Table, mapped: Mapping[str, Any]) -> Mend:
    """Return what a map says of a clock that starts again, or whose stamps repeat.

    Raises:
        LogError: the clock lost its digits.
    """
    time = clock_of(table, parse_column_map({"time": mapped.get("time", {})}).time)
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


def guess_map(robot: Robot, paths: Sequence[str | Path], start: MapGuess) -> MapGuess:
    """Return a guess corrected by what the rows say against the robot.

    Joints by motion and torque, units by derivative, sides by ratio, signs by gravity.

    Args:
        robot: whose logs they are, as far as it is known.
        paths: the logs.
        start: from the names.
    """
    table, reasons = dict(start.table), list(start.reasons)
    for left in reversed(range(_ROUNDS + 1)):
        logs = load_logs(paths[:_LOGS], parse_column_map(table, "", single_ratios(robot)))[:_LOGS]
        found = [finding for own in find_suspicions(logs, robot) for finding in own]
        lacks = [check_robot(log, robot) for log in logs]
        doubts = [f for own in (found, *lacks) for f in own if _mends(f, table)]
        if not doubts or not left:
            break
        said = {repr(f.mend): f for f in reversed(doubts)}
        for finding in reversed(said.values()):
            table = merged(table, finding.mend)
            reasons.append(f"{finding.text} (probability {finding.probability:.2f})")
    refused = [finding for finding in found if finding.severity == "error"]
    lacking = tuple({finding.text: finding for finding in [*lacks[0], *refused]}.values())
    why, told = tuple(dict.fromkeys(reasons)), told_by_rows(robot, logs)
    return replace(start, table=table, reasons=why, told=told, lacking=lacking)


def _mends(found: LogFinding, table: Mapping[str, Any]) -> bool:
    """Whether a finding mends all logs, and the names in a map do not deny it: angles in rad."""
    entries = [table.get("columns", {}).get(name, {}) for name in found.mend.get("columns", {})]
    denied = found.kind == "degrees" and any(entry.get("unit") == "rad" for entry in entries)
    likely = found.probability >= LIKELY and found.kind not in _LACKS
    return bool(found.mend) and not found.alone and likely and not denied


def guessed_numbers(path: str | Path) -> list[str]:
    """Return the numbers of a robot description that are still guesses, `gears.knee.gear_ratio`.

    Empty for a robot that is no file.
    """
    file = Path(path)
    gears = tomllib.loads(file.read_text("utf-8")).get("gears", {}) if file.is_file() else {}
    return [
        f"gears.{joint}.{key}"
        for joint, numbers in gears.items()
        for key, number in numbers.items()
        if isinstance(number, dict) and str(number.get("source", "")).startswith(_GUESS)
    ]


def model_joints(path: Path, base: str) -> tuple[str, ...]:
    """Return the joints of a model file that a gear can drive.

    Raises:
        RobotError: a file that cannot be read, or without such a joint.
    """
    model, _ = read_model(path, base, [])
    joints = driven_joints(model)
    if not joints:
        raise RobotError(f"'{path}' has no joint with one degree of freedom for a gear to drive.")
    return joints


def write_robot(
    target: str | Path,
    model: Path,
    base: str,
    driven: Sequence[str],
    targets: Sequence[str] = (),
    held: Sequence[str] = (),
    ratios: Mapping[str, Ratio] | None = None,
    *,
    shared: bool = False,
) -> Path:
    """Write a robot.toml whose numbers come from the model file, or are marked as guesses.

    Args:
        target: the file.
        model: URDF or MJCF.
        base: fixed or free_flyer.
        driven: joints that get a gear.
        targets: joints of those whose drive follows a target that the logs hold, without a torque.
        held: joints that are welded at zero.
        ratios: gear ratios that the logs tell.
        shared: whether one table holds the guesses for all gears; what the model file states of a
            joint stands in a table of its own.
    """
    stated = _stated(model)
    lines = [
        "# Written by `wbc init`. Numbers whose source is 'guess' are to be looked up.",
        f'name = "{model.resolve().stem}"',
        f'model = "{model.resolve().as_posix()}"',
        f'base = "{base}"',
    ]
    if names := ", ".join(f'"{joint}"' for joint in held):
        lines.append(f"lock = [{names}]  # guess: no column with their position, so held at zero")
    own = [joint for joint in driven if joint in stated] if shared else driven
    for joint in ("*", *own) if shared else own:
        ratio, inertia = stated.get(joint, (None, None))
        told, why = (ratios or {}).get(joint, (1.0, "torque is then taken behind the gear"))
        known = "it scales every torque: the gains of the drive make the torque of the target"
        gains = [("kp", None, _KP, "N m/rad", known), ("kd", None, _KD, "N m s/rad", "as kp")]
        inertias = ("rotor_inertia", inertia, 0.0, "kg m^2", "the diagnosis can find it")
        lines += ["", f'[gears."{joint}"]', _number("gear_ratio", ratio, told, "1", why)]
        lines += [_number(*one) for one in (inertias, *(gains if joint in targets else ()))]
    return write_text(Path(target), "\n".join(lines) + "\n")


def _number(key: str, stated: float | None, guess: float, unit: str, why: str) -> str:
    source = f"{_GUESS}; {why}" if stated is None else "the model file"
    value = guess if stated is None else stated
    return f'{key} = {{ value = {value}, unit = "{unit}", source = "{source}" }}'


def _stated(path: Path) -> Mapping[str, tuple[float, float | None]]:
    """Return joint -> (gear ratio, inertia of the rotor if known) that a model file states.

    By the <transmission> elements of a URDF, and the armature of a joint itself in an MJCF.
    """
    root, found = xml_root(path), dict[str, tuple[float, float | None]]()
    for element in root.iter("transmission"):
        joint, ratio = element.find("joint"), element.findtext(".//mechanicalReduction") or ""
        with suppress(ValueError):
            if joint is not None and float(ratio) != 0.0:
                found[str(joint.get("name"))] = (float(ratio), None)
    for joint in root.iter("joint"):
        if (name := joint.get("name")) and (own := joint.get("armature")):
            found[name] = (1.0, float(own))
    return found
