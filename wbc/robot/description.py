"""Reading `robot.toml`: the model file, the gears, the contacts, each number with its source."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import RobotError, unknown_name
from wbc.robot.contact import ContactPoint
from wbc.robot.library import find_description, find_model, robot_names
from wbc.robot.model_file import read_model
from wbc.robot.robot import Robot, RobotSource
from wbc.robot.units import to_si
from wbc.transmission import Transmission

_GEAR_UNITS = {
    "gear_ratio": "1",
    "rotor_inertia": "kg m^2",
    "forward_efficiency": "1",
    "backward_efficiency": "1",
    "rotor_coulomb_friction": "N m",
    "rotor_viscous_friction": "N m s/rad",
    "torque_limit": "N m",
    "speed_limit": "rad/s",
    "torque_constant": "N m/A",
    "resistance": "ohm",
    "stiffness": "N m/rad",
    "damping": "N m s/rad",
    "backlash": "rad",
}
_TOP_LEVEL = {"name", "model", "base", "lock", "gravity", "transmission", "gears", "contacts"}


@dataclass(frozen=True)
class RobotDescription:
    """A parsed `robot.toml`, or a file that adds effects to one.

    Attributes:
        path: the file.
        table: its content.
    """

    path: Path
    table: Mapping[str, Any]

    @property
    def base_robot(self) -> str | None:
        """Name or path of the robot that this file adds effects to; None if it is one itself."""
        reference = self.table.get("robot")
        return None if reference is None else str(reference)


def read_description(name: str | Path) -> RobotDescription:
    """Find and parse the description of a robot.

    Raises:
        RobotError: no such robot, or a file that is not TOML (with the place of the mistake).
    """
    path = find_description(name)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as cause:
        raise RobotError(f"cannot read the robot description '{path}': {cause}.") from cause
    return RobotDescription(path, table)


def build_robot(description: RobotDescription) -> Robot:
    """Return the robot that a description describes, without effects.

    Raises:
        RobotError: a key, unit, joint or file that does not exist; the message names the place.
        TransmissionError: a number outside its range.
    """
    table, path = description.table, description.path
    for key in table:
        if key not in _TOP_LEVEL:
            raise RobotError(f"{path}: " + unknown_name("key", key, sorted(_TOP_LEVEL)))
    if "model" not in table:
        raise RobotError(f"{path}: the key 'model' is missing (the URDF or MJCF file).")
    model, notes = read_model(
        find_model(str(table["model"]), path.parent),
        base=str(table.get("base", "fixed")),
        lock=[str(name) for name in table.get("lock", [])],
    )
    if "gravity" in table:
        model.gravity.linear = np.asarray(_numbers(table["gravity"], "m/s^2", f"{path}: gravity"))
    return Robot(
        name=str(table.get("name", path.parent.name)),
        model=model,
        transmission=_transmission(table, path),
        contacts=tuple(_contact(entry, path) for entry in table.get("contacts", [])),
        rotors_turn_with_links=bool(table.get("transmission", {}).get("rotor_coupling", False)),
        source=RobotSource(_source_name(path)),
        notes=notes,
    )


def _source_name(path: Path) -> str:
    """Return a shipped robot's bare name, or the full path of any other description."""
    shipped = path.parent.name
    if shipped in robot_names() and path.resolve() == find_description(shipped).resolve():
        return shipped
    return str(path.resolve())


def _transmission(table: Mapping[str, Any], path: Path) -> Transmission:
    gears = table.get("gears", {})
    columns: dict[str, list[float]] = {}
    defaults = {"torque_constant": np.nan, "resistance": np.nan, "forward_efficiency": 1.0}
    for joint, gear in gears.items():
        for key in gear:
            if key not in _GEAR_UNITS:
                raise RobotError(
                    f"{path}: gear of '{joint}': " + unknown_name("key", key, _GEAR_UNITS)
                )
        for key in ("gear_ratio", "rotor_inertia"):
            if key not in gear:
                raise RobotError(f"{path}: gear of '{joint}': the key '{key}' is missing.")
    used = [key for key in _GEAR_UNITS if any(key in gear for gear in gears.values())]
    for key in used:
        columns[key] = [
            _number(gear[key], _GEAR_UNITS[key], f"{path}: gear of '{joint}': {key}")
            if key in gear
            else _default(key, gear, defaults, f"{path}: gear of '{joint}'")
            for joint, gear in gears.items()
        ]
    columns.setdefault("gear_ratio", [])
    columns.setdefault("rotor_inertia", [])
    topology = table.get("transmission", {}).get("topology")
    arrays: dict[str, Any] = dict(columns)
    if topology is not None:
        arrays["topology"] = _numbers(topology, "1", f"{path}: topology")
    return Transmission(joints=tuple(gears), **arrays)


def _default(key: str, gear: Mapping[str, Any], defaults: Mapping[str, float], place: str) -> float:
    """Return what a gear has that leaves out a key which another gear gives."""
    if key == "backward_efficiency":
        eta_f = _number(gear["forward_efficiency"], "1", place) if len(gear) else 1.0
        return 2.0 - 1.0 / eta_f
    if key in ("torque_limit", "speed_limit", "stiffness"):
        return float("inf")
    return defaults.get(key, 0.0)


def _contact(entry: Mapping[str, Any], path: Path) -> ContactPoint:
    for key in ("name", "frame"):
        if key not in entry:
            raise RobotError(f"{path}: a contact lacks the key '{key}'.")
    place = f"{path}: contact '{entry['name']}'"
    offset = _numbers(entry.get("offset", {"value": [0.0, 0.0, 0.0], "unit": "m"}), "m", place)
    friction = _number(entry.get("friction", {"value": 0.7, "unit": "1"}), "1", place)
    return ContactPoint(str(entry["name"]), str(entry["frame"]), offset, friction)


def _number(entry: Any, unit: str, place: str) -> float:
    value = _numbers(entry, unit, place)
    if value.ndim != 0:
        raise RobotError(f"{place}: one number expected, got {value.tolist()}.")
    return float(value)


def _numbers(entry: Any, unit: str, place: str) -> FloatArray:
    """Return the SI value of a number, or of a table {value, unit, source}."""
    if isinstance(entry, Mapping):
        if "value" not in entry:
            raise RobotError(f"{place}: the key 'value' is missing.")
        given, stated = entry["value"], str(entry.get("unit", unit))
    else:
        given, stated = entry, unit
    try:
        array = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as cause:
        raise RobotError(f"{place}: {given!r} is not a number.") from cause
    return np.asarray(array * to_si(1.0, stated, unit, place))


def bare_robot(model: pin.Model, name: str = "robot") -> Robot:
    """Return a robot without gears around a pinocchio model (for tests and kinematics)."""
    return Robot(name, model, Transmission((), np.zeros(0), np.zeros(0)))
