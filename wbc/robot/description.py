"""Robots from their own description, `robot.toml` beside a URDF or MJCF file, by name or path."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from math import pi
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, checked
from wbc.errors import RobotError, require_known, unknown_name
from wbc.files import load_table
from wbc.robot.coordinates import unit_at
from wbc.robot.model_file import closed_loops, driven_joints, read_model
from wbc.robot.robot import BodySurface, ContactPoint, Robot, RobotSource
from wbc.transmission import GEAR_NUMBERS, Transmission, wedge_backward_efficiency

_FIELDS = {"kp": "position_gain", "kd": "velocity_gain"}
_KEYS = {field: key for key, field in _FIELDS.items()}
GEAR_UNITS = {_KEYS.get(name, name): number.unit for name, number in GEAR_NUMBERS.items()}
"""Key of [gears.JOINT] -> unit."""

_SENSOR = "torque_sensor"  # of a gear: a sensor behind it measures joint_torque
_ALL = "*"  # [gears."*"]: every joint that a gear can drive


_PACKAGE = Path(__file__).resolve().parents[1]
_SOURCES = (_PACKAGE / "_robots", _PACKAGE.parent / "robots")


def robots_directory() -> Path:
    """Return the folder of the shipped robots (inside the wheel, or beside `wbc` in a checkout).

    Raises:
        RobotError: the installation lacks the folder.
    """
    for folder in _SOURCES:
        if folder.is_dir():
            return folder
    raise RobotError("the shipped robots are missing from this installation; reinstall wbc.")


def robot_names() -> tuple[str, ...]:
    """Return the names of the shipped robots."""
    return tuple(sorted(p.parent.name for p in robots_directory().glob("*/robot.toml")))


def find_description(name: str | Path) -> Path:
    """Return the TOML file that describes a robot.

    Args:
        name: a shipped robot's name, a TOML file, or a folder that holds `robot.toml`.

    Raises:
        RobotError: nothing of that name; the message lists the shipped robots.
    """
    path = Path(name)
    if path.suffix == ".toml":
        if path.is_file():
            return path
        raise RobotError(f"no robot description at '{path}'.")
    if (path / "robot.toml").is_file():
        return path / "robot.toml"
    if str(name) not in robot_names():
        unknown = unknown_name("robot", str(name), robot_names())
        raise RobotError(f"{unknown} Or give the path of a robot.toml.")
    return robots_directory() / str(name) / "robot.toml"


def find_model(reference: str, folder: Path) -> Path:
    """Return the URDF or MJCF file that a description refers to.

    Args:
        reference: a path relative to the description, or `package:path` for a file inside an
            installed Python package (for example `example_robot_data:robots/...`).
        folder: folder of the description.

    Raises:
        RobotError: no such file or package.
    """
    if ":" not in reference:
        path = (folder / reference).resolve()
        if not path.is_file():
            raise RobotError(f"the model file '{reference}' is not in '{folder}'.")
        return path
    package, inner = reference.split(":", 1)
    # wheels built with cmeel put files under a shared prefix instead of a package of their own
    spec = find_spec(package) if package.isidentifier() else None
    own = list(spec.submodule_search_locations or []) if spec is not None else []
    prefix = Path(pin.__file__).resolve().parents[4] / "share" / package.replace("_", "-")
    for root in (*map(Path, own), prefix):
        candidate = root / inner
        if candidate.is_file():
            return candidate
    raise RobotError(
        f"the model '{inner}' of package '{package}' is not installed; "
        f"install it with: pip install {package.replace('_', '-')}"
    )


def read_description(name: str | Path) -> tuple[Path, dict[str, Any]]:
    """Find and parse the description of a robot, or a file that adds effects to one.

    Raises:
        RobotError: no such robot, or a file that is not TOML (with the place of the mistake).
    """
    path = find_description(name)
    return path, load_table(path, "the robot description", RobotError)


def build_robot(path: Path, table: Mapping[str, Any]) -> Robot:
    """Return the robot that a description, a file and its content, describes, without effects.

    Raises:
        RobotError: a key, unit, joint or file that does not exist; the message names the place.
        TransmissionError: a number outside its range.
    """
    told = table_in(table, _TOP_LEVEL, f"{path}")
    if "model" not in told:
        raise RobotError(f"{path}: the key 'model' is missing (the URDF or MJCF file).")
    file = find_model(told["model"], path.parent)
    model, notes = read_model(file, told.get("base", ""), told.get("lock", ()))
    if "gravity" in told:
        model.gravity.linear = checked(told["gravity"], (3,), f"{path}: gravity", RobotError)
    settings, gears = told.get("transmission", {}), _gears(told.get("gears", {}), model)
    full, name = path.resolve(), path.parent.name
    shipped = name in robot_names() and full == find_description(name).resolve()
    only = tuple(j for j, gear in gears.items() if gear.get(_SENSOR) and "gear_ratio" not in gear)
    robot = Robot(
        name=told.get("name", full.parent.name),
        model=model,
        transmission=_transmission(gears, only, settings.get("topology"), path),
        contacts=told.get("contacts", ()),
        rotors_turn_with_links=settings.get("rotor_coupling", False),
        source=RobotSource(name if shipped else str(full), model=file),
        notes=notes,
        loops=() if told.get("cut_loops") or "topology" in settings else closed_loops(file),
        sensor_only=only,
        surface=BodySurface(**told.get("bodies", {})),
    )
    return replace(robot, poses=_poses(robot, told.get("poses", {}), f"{path}"))


def with_gear_numbers(robot: Robot, gears: Any, path: Path) -> Robot:
    """Return a robot with some numbers of its gears replaced, as [gears.JOINT] of a file says.

    Raises:
        RobotError: a joint, number or unit that does not exist; the message names the place.
        TransmissionError: a number outside its range.
    """
    changed = robot.transmission
    for joint, numbers in _gear_tables(gears, f"{path}: gears", _GEAR_NUMBERS).items():
        changed = changed.with_values(joint, numbers)
    return robot.with_transmission(changed)


def _gears(own: dict[str, dict[str, Any]], model: pin.Model) -> dict[str, dict[str, Any]]:
    """Return one table per driven joint: [gears."*"] is that of all joints with one degree.

    The table of a joint of its own adds to it, or replaces its numbers.
    """
    shared = own.pop(_ALL, None)
    if shared is not None:
        own = {joint: {**shared, **own.pop(joint, {})} for joint in driven_joints(model)} | own
    return own


def _transmission(
    gears: Mapping[str, Mapping[str, Any]], sensor_only: Sequence[str], topology: Any, path: Path
) -> Transmission:
    for joint, gear in gears.items():
        for key in ("gear_ratio", "rotor_inertia"):
            if key not in gear and joint not in sensor_only:
                raise RobotError(
                    f"{path}: gear of '{joint}': the key '{key}' is missing. Where logs hold "
                    f"nothing but a torque sensor behind the gear, {_SENSOR} = true stands in "
                    "place of both."
                )
    each = [{**_LEFT_OUT, **gear} for gear in gears.values()]
    for gear in each:
        forward = gear["forward_efficiency"]
        gear.setdefault("backward_efficiency", float(wedge_backward_efficiency(forward)))
    arrays: dict[str, Any] = {name: [gear[name] for gear in each] for name in GEAR_NUMBERS}
    housings = tuple(gear.get("housing", "") for gear in each)
    return Transmission(joints=tuple(gears), topology=topology, housings=housings, **arrays)


def bare_robot(model: pin.Model, name: str = "robot") -> Robot:
    """Return a robot without gears around a pinocchio model (for tests and kinematics)."""
    return Robot(name, model, Transmission((), np.zeros(0), np.zeros(0)))


_BASE = ("base.position.x", "base.position.y", "base.position.z")


def _poses(robot: Robot, table: Any, place: str) -> Mapping[str, FloatArray]:
    """Return pose name -> q (nq,), joints left out being at their neutral position.

    The table holds `[poses.NAME]` of joint = {value, unit, source}; base.position.x|y|z sets that
    of a free-flyer.

    Raises:
        RobotError: no table, an unknown joint, or no number.
    """
    if not isinstance(table, Mapping):
        raise RobotError(f"{place}: poses: one table per pose expected, [poses.NAME].")
    rows = {joint: robot.position_index(joint) for joint in robot.single_joints}
    readers, poses = {joint: quantity(unit_at(robot, joint, "rad")) for joint in rows}, {}
    if robot.has_free_flyer:
        rows |= {name: row for row, name in enumerate(_BASE)}
        readers |= dict.fromkeys(_BASE, quantity("m"))
    for name, entry in table.items():
        at = f"{place}: pose '{name}'"
        poses[str(name)] = q = robot.neutral()
        for joint, value in table_in(entry, readers, at, "a table of joints", "joint").items():
            q[rows[joint]] = value
    return poses


def state_gear(joint: str, *keys: str) -> str:
    """Return how to state numbers of a gear, with the lines to copy.

    The lines stand below the sentence, indented; what follows them belongs on a new line.

    Args:
        joint: whose gear.
        keys: of [gears.JOINT], see docs/diagnosis/describe-your-robot.md.
    """
    line = '\n    {} = {{ value = VALUE, unit = "{}", source = "data sheet" }}'
    lines = "".join(line.format(key, GEAR_UNITS[key]) for key in keys)
    return f"put the number in place of VALUE, below [gears.{joint}] in robot.toml:{lines}"


Reader: TypeAlias = Callable[[Any, str], Any]
"""Returns what a value of a file means; raises RobotError with the place where it means nothing."""


def table_in(
    entry: Any, readers: Mapping[str, Reader], place: str, what: str = "a table", kind: str = "key"
) -> dict[str, Any]:
    """Return the values of a table, each as its key reads it.

    Args:
        entry: what the file holds.
        readers: of the keys that there are.
        place: of the table, for messages.
        what: is expected there.
        kind: what its keys are.

    Raises:
        RobotError: no table, an unknown key, or a value that its key cannot read.
    """
    if not isinstance(entry, Mapping):
        raise RobotError(f"{place}: {what} expected, got {entry!r}.")
    for key in entry:
        require_known(RobotError, kind, key, readers, place)
    return {key: readers[key](value, f"{place}: {key}") for key, value in entry.items()}


def _text(entry: Any, place: str) -> str:
    return str(entry)


def _as_it_is(entry: Any, place: str) -> Any:
    return entry


def _flag(entry: Any, place: str) -> bool:
    if not isinstance(entry, bool):
        raise RobotError(f"{place}: true or false expected, got {entry!r}.")
    return entry


def _listed(what: str, item: Reader = _text, size: int = 0) -> Reader:
    """Return what reads a list, of so many items where a size is given."""

    def read(entry: Any, place: str) -> tuple[Any, ...]:
        if not isinstance(entry, list) or (size and len(entry) != size):
            raise RobotError(f"{place}: {what} expected, got {entry!r}.")
        return tuple(item(one, f"{place}[{k}]") for k, one in enumerate(entry))

    return read


def _several(unit: str) -> Reader:
    return lambda entry, place: numbers_in(entry, unit, place)


def quantity(unit: str) -> Reader:
    """Return what reads one number of a unit; see `numbers_in`."""

    def read(entry: Any, place: str) -> float:
        value = numbers_in(entry, unit, place)
        if value.ndim != 0:
            raise RobotError(f"{place}: one number expected, got {value.tolist()}.")
        return float(value)

    return read


def _gear_tables(entry: Any, place: str, readers: Mapping[str, Reader]) -> dict[str, Any]:
    """Return the tables [gears.JOINT] with numbers by the fields of a transmission."""
    if not isinstance(entry, Mapping):
        raise RobotError(f"{place}: one table per driven joint expected, [gears.JOINT].")
    tables = {j: table_in(own, readers, f"{place}: gear of '{j}'") for j, own in entry.items()}
    return {j: {_FIELDS.get(key, key): x for key, x in own.items()} for j, own in tables.items()}


def _contact(entry: Any, place: str) -> ContactPoint:
    told = table_in(entry, _CONTACT, place)
    for key in ("name", "frame"):
        if key not in told:
            raise RobotError(f"{place}: a contact lacks the key '{key}'.")
    return ContactPoint(**{"offset": np.zeros(3), **told})


_GEAR_NUMBERS = {key: quantity(unit) for key, unit in GEAR_UNITS.items()}
_GEAR = _GEAR_NUMBERS | {"housing": _text, _SENSOR: _flag}
_LEFT_OUT = {name: one.default for name, one in GEAR_NUMBERS.items() if one.default is not None}
_LEFT_OUT |= {"gear_ratio": 1.0, "rotor_inertia": 0.0}  # where only a sensor is known
_CONTACT = {"name": _text, "frame": _text, "offset": _several("m")}
_CONTACT |= {"friction": quantity("1"), "radius": quantity("m"), "sensor_gain": quantity("1")}
_TRANSMISSION = {"topology": _several("1"), "rotor_coupling": _flag}
_TWO = "lists of two bodies"
_BODIES = {
    "links": _listed("names of bodies"),
    "friction": quantity("1"),
    "depth": quantity("m"),
    "pairs": _listed(_TWO, _listed(_TWO, size=2)),
}
_TOP_LEVEL: Mapping[str, Reader] = {
    **dict.fromkeys(("name", "model", "base"), _text),
    "lock": _listed("a list of joint names"),
    "cut_loops": _flag,
    "gravity": _several("m/s^2"),
    "transmission": lambda entry, place: table_in(entry, _TRANSMISSION, place),
    "gears": lambda entry, place: _gear_tables(entry, place, _GEAR),
    "contacts": _listed("a list of tables", _contact),
    "bodies": lambda entry, place: table_in(entry, _BODIES, place),
    "poses": _as_it_is,
}
_NUMBER = {"value": _as_it_is, "unit": _text}
_NUMBER |= dict.fromkeys(("source", "note", "low", "high"), _as_it_is)


def numbers_in(entry: Any, unit: str, place: str) -> FloatArray:
    """Return the SI values (...) of numbers, or of a table {value, unit, source} of them.

    Args:
        entry: what the TOML file holds.
        unit: SI unit expected, and meant where none is stated.
        place: file and key, for the message.

    Raises:
        RobotError: no number, an unknown key or unit, or a unit of another quantity.
    """
    told = table_in(entry, _NUMBER, place) if isinstance(entry, Mapping) else {"value": entry}
    if "value" not in told:
        raise RobotError(f"{place}: the key 'value' is missing.")
    given, stated = told["value"], told.get("unit", unit)
    if not _holds_numbers(given):
        raise RobotError(f"{place}: {given!r} is not a number.")
    try:
        array = np.asarray(given, dtype=np.float64)
    except ValueError as cause:
        raise RobotError(f"{place}: the rows of {given!r} differ in length.") from cause
    require_known(RobotError, "unit", stated, SI_UNITS, place)
    dimension, factor = SI_UNITS[stated]
    if dimension != unit:
        raise RobotError(f"{place}: unit '{stated}' measures [{dimension}], expected [{unit}].")
    return np.asarray(array * factor)


def _holds_numbers(given: Any) -> bool:
    """Whether `given` is a number or nested lists of numbers; TOML's true and "3" are none."""
    if isinstance(given, list):
        return all(_holds_numbers(item) for item in given)
    return isinstance(given, (int, float)) and not isinstance(given, bool)


_SI = (
    "1|m|rad|kg|kg m^2|N|N m|rad/s|N m s/rad|N m s^2/rad^2|N m/rad|N m/A|ohm|s|1/K|1/W|1/s|1/rad|"
    "V|A|m/s^2"
)
SI_UNITS: dict[str, tuple[str, float]] = {unit: (unit, 1.0) for unit in _SI.split("|")} | {
    "rad/m": ("1", 1.0),  # of a slide's gear ...
    "N/m": ("N m/rad", 1.0),  # ... and of its drive
    "N s/m": ("N m s/rad", 1.0),
    "mm": ("m", 1e-3),
    "deg": ("rad", pi / 180.0),
    "arcmin": ("rad", pi / 10800.0),
    "g": ("kg", 1e-3),
    "g cm^2": ("kg m^2", 1e-7),
    "kg cm^2": ("kg m^2", 1e-4),
    "mN m": ("N m", 1e-3),
    "rpm": ("rad/s", pi / 30.0),
    "ms": ("s", 1e-3),
}
"""Unit -> the SI unit of its quantity, and its size in that."""
