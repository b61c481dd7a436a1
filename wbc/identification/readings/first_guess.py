"""A first column map corrected by the rows, and a first description of a robot."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from wbc.errors import RobotError
from wbc.files import write_text
from wbc.identification.readings.checks import check_robot
from wbc.identification.readings.mistakes import find_suspicions, single_ratios, told_by_rows
from wbc.measurement.column_map import merged, parse_column_map
from wbc.measurement.guess import MapGuess, guess_table
from wbc.measurement.log import LIKELY, LogFinding
from wbc.measurement.names import MOTION, guess_names_of, joints_of
from wbc.measurement.read import load_logs
from wbc.measurement.schema import LOG_UNITS
from wbc.robot import Robot
from wbc.robot.model_file import driven_joints, read_model, xml_root

_LOGS = 4  # of a file that are looked at: a guess needs no more
_ROUNDS = 6  # of corrections, one upon another
_LACKS = ("joints_unknown", "no_torque")  # what is not there is not guessed twice
_DIRECT = 0.1
"""How close to 1 a ratio may be: a motor's motion is often reported in units of the joint, and then
it tells no ratio."""
_OTHERWISE = 0.01  # of the power of a motor's motion that its joint's may leave
_KP, _KD = 20.0, 0.5  # gains of a small position drive: a start that has to be replaced
_GUESS = "guess: not in the model file; look it up"


Ratio: TypeAlias = tuple[float, str]
"""Turns of the motor per turn of the joint, without sign, and the columns that tell it."""


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
        doubts = [
            finding
            for finding in (*found, *(one for own in lacks for one in own))
            if finding.mend
            and not finding.alone
            and finding.kind not in _LACKS
            and finding.probability >= LIKELY
            and not _denied(finding, table)
        ]
        if not doubts or not left:
            break
        said = {repr(f.mend): f for f in reversed(doubts)}
        for finding in reversed(said.values()):
            table = merged(table, finding.mend)
            reasons.append(f"{finding.text} (probability {finding.probability:.2f})")
    refused = [finding for finding in found if finding.severity == "error"]
    lacking = {finding.text: finding for finding in [*lacks[0], *refused]}
    told = told_by_rows(robot, logs)
    reasons = list(dict.fromkeys(reasons))
    wanted = tuple(lacking.values())
    return replace(start, table=table, reasons=tuple(reasons), told=told, lacking=wanted)


def _denied(finding: LogFinding, table: Mapping[str, Any]) -> bool:
    """Whether the names say what a finding doubts: angles in rad."""
    entries = [table.get("columns", {}).get(name, {}) for name in finding.mend.get("columns", {})]
    return finding.kind == "degrees" and any(entry.get("unit") == "rad" for entry in entries)


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
    ratios: Mapping[str, Ratio] = MappingProxyType({}),
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
    if held:
        names = ", ".join(f'"{joint}"' for joint in held)
        lines.append(f"lock = [{names}]  # guess: no column with their position, so held at zero")
    own = [joint for joint in driven if joint in stated] if shared else driven
    for joint in ("*", *own) if shared else own:
        ratio, inertia = stated.get(joint, (None, None))
        told, why = ratios.get(joint, (1.0, "torque is then taken behind the gear"))
        known = "it scales every torque: the gains of the drive make the torque of the target"
        gains = [("kp", None, _KP, "N m/rad", known), ("kd", None, _KD, "N m s/rad", "as kp")]
        inertias = ("rotor_inertia", inertia, 0.0, "kg m^2", "the diagnosis can find it")
        lines += ["", f'[gears."{joint}"]', _number("gear_ratio", ratio, told, "1", why)]
        lines += [_number(*one) for one in (inertias, *(gains if joint in targets else ()))]
    return write_text(Path(target), "\n".join(lines) + "\n")


def _number(key: str, value: float | None, guess: float, unit: str, why: str) -> str:
    known = value is not None
    source = "the model file" if known else f"{_GUESS}; {why}"
    return (
        f'{key} = {{ value = {value if known else guess}, unit = "{unit}", source = "{source}" }}'
    )


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


def guess_ratios(
    path: str | Path, joints: Sequence[str], start: Mapping[str, Any] | None = None
) -> Mapping[str, Ratio]:
    """Return the gear ratios of those joints whose motion a log holds on both sides of the gear.

    Names say which column is the motor's (`knee_motor_vel` beside `knee_vel`). Nothing is said
    where only one of the two names its unit: then the ratio may be a matter of units.

    Args:
        path: a log.
        joints: of the robot, with one degree of freedom.
        start: a column map that the user gives.
    """
    table = guess_table(path, start or {})
    guesses = [g for g in guess_names_of(table.names) if g.quantity in MOTION]
    own = {(g.owner, g.quantity): g for g in guesses if not g.rotor}
    named = joints_of(list(dict.fromkeys(owner for owner, _ in own)), joints)
    found: dict[str, Ratio] = {}
    motors = sorted((g for g in guesses if g.rotor), key=lambda g: g.quantity, reverse=True)
    for rotor in motors:  # by velocities first
        joint, (name, _) = own.get((rotor.owner, rotor.quantity)), named.get(rotor.owner, ("", ""))
        if not joint or not name or name in found or bool(rotor.unit) != bool(joint.unit):
            continue
        worth = [LOG_UNITS[g.unit][1] if g.unit else 1.0 for g in (joint, rotor)]
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
