"""Loading a robot with its effects, and saving one: `fitted.toml` is usable wherever a name is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from wbc.effects.catalogue import effect_class
from wbc.effects.gear_losses import SIDES
from wbc.errors import RobotError, require_known
from wbc.files import SCHEMA, write_text
from wbc.robot import Effect, Robot
from wbc.robot.description import build_robot, quantity, read_description, with_gear_numbers
from wbc.robot.robot import RobotSource
from wbc.transmission import DRIVE_TIMES

_KEYS = ("robot", "lossless", "gears", "effects", "provenance")


def load_robot(name: str | Path) -> Robot:
    """Return the robot called `name`: a shipped one, a `robot.toml`, or a saved file with effects.

    Args:
        name: a shipped robot's name, the path of a description, or of a file written by
            `save_robot`.

    Raises:
        RobotError: nothing of that name, or a mistake in the file (the message says where).
        EffectError: an effect, place or parameter that does not exist or is out of bounds.
    """
    return _load(name, ())


def _load(name: str | Path, referring: tuple[Path, ...]) -> Robot:
    path, table = read_description(name)
    if "robot" not in table:
        return build_robot(path, table)
    base = str(table["robot"])
    if path.resolve() in referring:
        raise RobotError(f"{path}: 'robot' refers back to this file through '{base}'.")
    for key in table:
        require_known(RobotError, "key", key, _KEYS, f"{path}")
    beside = path.parent / base  # it may lie beside this file
    described = beside.is_file() or (beside / "robot.toml").is_file()
    robot = _load(beside if described else base, (*referring, path.resolve()))
    if table.get("lossless", False):
        robot = robot.lossless()
    if "gears" in table:
        robot = with_gear_numbers(robot, table["gears"], path)
        # A file without effects is itself what `save_robot` refers to.
        if not robot.effects and not table.get("effects"):
            model = None if robot.source is None else robot.source.model
            robot = replace(robot, source=RobotSource(str(path.resolve()), model=model))
    for entry in table.get("effects", []):
        robot = robot.with_effect(_effect(entry, path))
    return robot


def _effect(entry: Mapping[str, Any], path: Path) -> Effect:
    for key in ("effect", "where"):
        if key not in entry:
            raise RobotError(f"{path}: an entry of [[effects]] lacks the key '{key}'.")
    kind, where = effect_class(str(entry["effect"])), str(entry["where"])
    units = {parameter.name: parameter.unit for parameter in kind.parameters}
    place, own, values = f"{path}: {kind.name} at '{where}'", {}, {}
    for name, number in entry.get("parameters", {}).items():
        if name not in units and isinstance(number, Mapping):  # the effect will know
            number, own[name] = {**number, "unit": "1"}, number.get("unit")
        values[name] = quantity(units.get(name, "1"))(number, f"{place}: {name}")
    effect = kind.at(where, values)
    constants, given = _constants(effect), entry.get("constants", {})
    for name, value in given.items():
        require_known(RobotError, "constant", name, constants, place)
        if type(value) is not type(constants[name]):
            expected = type(constants[name]).__name__
            raise RobotError(f"{place}: {name}: {value!r} stands where a {expected} is expected.")
    side = given.get("friction_side")
    if side is not None and side not in SIDES:
        raise RobotError(f"{place}: friction_side '{side}' is none of {', '.join(SIDES)}.")
    for p in effect.parameters:
        unit = own.get(p.name, p.unit)
        if unit not in (None, p.unit):
            raise RobotError(f"{place}: {p.name}: unit '{unit}' stands where [{p.unit}] should.")
    return replace(effect, **given) if given else effect


def _constants(effect: Effect) -> dict[str, Any]:
    """Return what an effect holds beside its numbers: fields that are given by their name alone."""
    return {f.name: getattr(effect, f.name) for f in fields(effect) if f.kw_only}


def save_robot(
    robot: Robot,
    path: str | Path,
    intervals: Mapping[tuple[str, str, str], tuple[float, float]] | None = None,
    provenance: Mapping[str, str] | None = None,
) -> Path:
    """Write a robot as its source plus its effects and the times of its drives.

    Args:
        robot: a robot that was loaded by name or path.
        path: TOML file to write (whole or not at all).
        intervals: (effect, where, parameter) -> (low, high), kept for the reader.
        provenance: free text such as logs and versions, kept for the reader.

    Raises:
        RobotError: a robot built or changed in code, which no file can refer to.
    """
    source = robot.source
    if source is None or source.changed:
        raise RobotError(
            f"'{robot.name}' was built or changed in code; only a robot loaded by name or path, "
            "with effects added to it, can be saved."
        )
    known, effects = intervals or {}, []
    for effect in robot.effects:
        entry: dict[str, Any] = {"effect": effect.name, "where": effect.where}
        if constants := _constants(effect):
            entry["constants"] = constants
        entry["parameters"] = numbers = {}
        for p in effect.parameters:
            span = known.get((effect.name, effect.where, p.name))
            ends = {} if span is None else {"low": float(span[0]), "high": float(span[1])}
            numbers[p.name] = {"value": effect.values[p.name], "unit": p.unit, **ends}
        effects.append(entry)
    table: dict[str, Any] = {"schema": SCHEMA, "robot": source.name, "lossless": source.lossless}
    if provenance:
        table["provenance"] = dict(provenance)
    for key in DRIVE_TIMES:
        times = getattr(robot.transmission, key).tolist()
        for joint, time in zip(robot.transmission.joints, times, strict=True):
            if np.isfinite(time):
                gear = table.setdefault("gears", {}).setdefault(joint, {})
                gear[key] = {"value": time, "unit": "s"}
    table["effects"] = effects
    return write_text(path, tomli_w.dumps(table))
