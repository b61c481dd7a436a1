"""Robots from their own description, `robot.toml` beside a URDF or MJCF file, by name or path."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from math import pi
from pathlib import Path
from typing import Any

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

_TOP_LEVEL = (
    "name",
    "model",
    "base",
    "lock",
    "cut_loops",
    "gravity",
    "transmission",
    "gears",
    "contacts",
    "bodies",
    "poses",
)
_LEFT_OUT = Transmission(("any",), np.ones(1), np.zeros(1))  # what stands for numbers not given
_SENSOR = "torque_sensor"  # of a gear: a sensor behind it measures joint_torque
_ALL = "*"  # [gears."*"]: every joint that a gear can drive
_TRANSMISSION_KEYS = ("topology", "rotor_coupling")
_CONTACT_KEYS = ("name", "frame", "offset", "friction", "radius")


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
    """Return the robot that a description describes, without effects.

    Args:
        path: the file.
        table: its content.

    Raises:
        RobotError: a key, unit, joint or file that does not exist; the message names the place.
        TransmissionError: a number outside its range.
    """
    check_keys(table, _TOP_LEVEL, f"{path}")
    if "model" not in table:
        raise RobotError(f"{path}: the key 'model' is missing (the URDF or MJCF file).")
    lock = table.get("lock", [])
    if not isinstance(lock, list):
        raise RobotError(f"{path}: lock: a list of joint names expected, got {lock!r}.")
    file = find_model(str(table["model"]), path.parent)
    model, notes = read_model(file, str(table.get("base", "")), list(map(str, lock)))
    if "gravity" in table:
        gravity = numbers_in(table["gravity"], "m/s^2", f"{path}: gravity")
        model.gravity.linear = checked(gravity, (3,), f"{path}: gravity", RobotError)
    settings = table_in(table.get("transmission", {}), _TRANSMISSION_KEYS, f"{path}: transmission")
    cut = flag_in(table, "cut_loops", f"{path}")
    full, name = path.resolve(), path.parent.name
    shipped = name in robot_names() and full == find_description(name).resolve()
    gears = _gears(table.get("gears", {}), model, path)
    only = tuple(j for j, gear in gears.items() if gear.get(_SENSOR) and "gear_ratio" not in gear)
    robot = Robot(
        name=str(table.get("name", full.parent.name)),
        model=model,
        transmission=_transmission(gears, only, settings.get("topology"), path),
        contacts=_contacts(table.get("contacts", []), path),
        rotors_turn_with_links=flag_in(settings, "rotor_coupling", f"{path}"),
        source=RobotSource(name if shipped else str(full), model=file),
        notes=notes,
        loops=() if cut or "topology" in settings else closed_loops(file),
        sensor_only=only,
        surface=_surface(table.get("bodies", {}), f"{path}: bodies"),
    )
    return replace(robot, poses=_poses(robot, table.get("poses", {}), f"{path}"))


def with_gear_numbers(robot: Robot, gears: Any, path: Path) -> Robot:
    """Return a robot with some numbers of its gears replaced, as [gears.JOINT] of a file says.

    Raises:
        RobotError: a joint, number or unit that does not exist; the message names the place.
        TransmissionError: a number outside its range.
    """
    changed = robot.transmission
    for joint, gear in _gear_tables(gears, (), path).items():
        place = f"{path}: gear of '{joint}'"
        numbers = {_FIELDS.get(key, key): _gear_number(gear, key, place) for key in gear}
        changed = changed.with_values(joint, numbers)
    return robot.with_transmission(changed)


def _gear_tables(entry: Any, more: tuple[str, ...], path: Path) -> dict[str, Mapping[str, Any]]:
    """Return the tables [gears.JOINT], with keys that there are: numbers of a gear, and `more`."""
    if not isinstance(entry, Mapping):
        raise RobotError(f"{path}: gears: one table per driven joint expected, [gears.JOINT].")
    keys = (*GEAR_UNITS, *more)
    return {j: table_in(gear, keys, f"{path}: gear of '{j}'") for j, gear in entry.items()}


def _gears(entry: Any, model: pin.Model, path: Path) -> dict[str, Mapping[str, Any]]:
    """Return one table per driven joint: [gears."*"] is that of all joints with one degree.

    The table of a joint of its own adds to it, or replaces its numbers.
    """
    own = _gear_tables(entry, ("housing", _SENSOR), path)
    shared = own.pop(_ALL, None)
    if shared is not None:
        own = {joint: {**shared, **own.pop(joint, {})} for joint in driven_joints(model)} | own
    return own


def _transmission(
    gears: Mapping[str, Mapping[str, Any]], sensor_only: Sequence[str], topology: Any, path: Path
) -> Transmission:
    for joint, gear in gears.items():
        place = f"{path}: gear of '{joint}'"
        flag_in(gear, _SENSOR, place)
        for key in ("gear_ratio", "rotor_inertia"):
            if key not in gear and joint not in sensor_only:
                raise RobotError(
                    f"{place}: the key '{key}' is missing. Where logs hold nothing but a torque "
                    f"sensor behind the gear, {_SENSOR} = true stands in place of both."
                )
    arrays: dict[str, Any] = {
        _FIELDS.get(key, key): [
            _gear_number(gear, key, f"{path}: gear of '{j}'") for j, gear in gears.items()
        ]
        for key in GEAR_UNITS
    }
    if topology is not None:
        arrays["topology"] = numbers_in(topology, "1", f"{path}: topology")
    housings = tuple(str(gear.get("housing", "")) for gear in gears.values())
    return Transmission(joints=tuple(gears), housings=housings, **arrays)


def _gear_number(gear: Mapping[str, Any], key: str, place: str) -> float:
    """Return a gear's number in SI, or what stands for a key that is left out."""
    if key in gear:
        return number_in(gear[key], GEAR_UNITS[key], f"{place}: {key}")
    if key == "backward_efficiency":
        return float(wedge_backward_efficiency(_gear_number(gear, "forward_efficiency", place)))
    return float(getattr(_LEFT_OUT, _FIELDS.get(key, key))[0])


def _contacts(entries: Any, path: Path) -> tuple[ContactPoint, ...]:
    if not isinstance(entries, list):
        raise RobotError(f"{path}: contacts: a list of tables expected, [[contacts]].")
    found = []
    for entry in entries:
        table_in(entry, _CONTACT_KEYS, f"{path}: contact")
        for key in ("name", "frame"):
            if key not in entry:
                raise RobotError(f"{path}: a contact lacks the key '{key}'.")
        name, frame = str(entry["name"]), str(entry["frame"])
        place = f"{path}: contact '{name}'"
        offset = numbers_in(entry.get("offset", [0.0, 0.0, 0.0]), "m", place)
        friction = number_in(entry.get("friction", 0.7), "1", place)
        radius = number_in(entry.get("radius", 0.0), "m", place)
        found.append(ContactPoint(name, frame, offset, friction, radius))
    return tuple(found)


def _surface(entry: Any, place: str) -> BodySurface:
    """Return what [bodies] says: which links touch the ground, and how."""
    given = dict(table_in(entry, ("links", "friction", "depth", "pairs"), place))
    for key, unit in (("friction", "1"), ("depth", "m")):
        if key in given:
            given[key] = number_in(given[key], unit, f"{place}: {key}")
    if "links" in given:
        if not isinstance(given["links"], list):
            raise RobotError(f"{place}: links: names of bodies expected, got {given['links']!r}.")
        given["links"] = tuple(map(str, given["links"]))
    if "pairs" in given:
        pairs = given["pairs"]
        if not (
            isinstance(pairs, list) and all(isinstance(p, list) and len(p) == 2 for p in pairs)
        ):
            raise RobotError(f"{place}: pairs: lists of two bodies expected, got {pairs!r}.")
        given["pairs"] = tuple((str(one), str(other)) for one, other in pairs)
    return BodySurface(**given)


def bare_robot(model: pin.Model, name: str = "robot") -> Robot:
    """Return a robot without gears around a pinocchio model (for tests and kinematics)."""
    return Robot(name, model, Transmission((), np.zeros(0), np.zeros(0)))


_BASE = ("base.position.x", "base.position.y", "base.position.z")


def _poses(robot: Robot, table: Any, place: str) -> Mapping[str, FloatArray]:
    """Return pose name -> q (nq,), joints left out being at their neutral position.

    Args:
        robot: the robot whose joints the poses set.
        table: `[poses.NAME]` tables of joint = {value, unit, source}; a free-flyer's position is
            set with base.position.x|y|z.
        place: the file, for messages.

    Raises:
        RobotError: no table, an unknown joint, or no number.
    """
    if not isinstance(table, Mapping):
        raise RobotError(f"{place}: poses: one table per pose expected, [poses.NAME].")
    known = (*robot.single_joints, *(_BASE if robot.has_free_flyer else ()))
    poses = {}
    for name, entry in table.items():
        at, q = f"{place}: pose '{name}'", robot.neutral()
        if not isinstance(entry, Mapping):
            raise RobotError(f"{at}: a table of joints expected, got {entry!r}.")
        for joint, value in entry.items():
            require_known(RobotError, "joint", joint, known, at)
            if joint in _BASE:
                q[_BASE.index(joint)] = number_in(value, "m", f"{at}: {joint}")
                continue
            unit = unit_at(robot, joint, "rad")
            q[robot.position_index(joint)] = number_in(value, unit, f"{at}: {joint}")
        poses[str(name)] = q
    return poses


def state_gear(joint: str, *keys: str) -> str:
    """Return how to state numbers of a gear, with the lines to copy.

    The lines stand below the sentence, indented; what follows them belongs on a new line.

    Args:
        joint: whose gear.
        keys: of [gears.JOINT], see docs/diagnosis/describe-your-robot.md.
    """
    lines = [
        f'{key} = {{ value = VALUE, unit = "{GEAR_UNITS[key]}", source = "data sheet" }}'
        for key in keys
    ]
    return (
        f"put the number in place of VALUE, below [gears.{joint}] in robot.toml:\n    "
        + "\n    ".join(lines)
    )


_NUMBER_KEYS = ("value", "unit", "source", "note", "low", "high")


def check_keys(table: Mapping[str, Any], known: Collection[str], place: str) -> None:
    """Raise RobotError at the first key of `table` that is not among those `known`."""
    for key in table:
        require_known(RobotError, "key", key, known, place)


def table_in(entry: Any, known: Collection[str], place: str) -> Mapping[str, Any]:
    """Return `entry` after checking that it is a table with known keys only.

    Raises:
        RobotError: it is not.
    """
    if not isinstance(entry, Mapping):
        raise RobotError(f"{place}: a table expected, got {entry!r}.")
    check_keys(entry, known, place)
    return entry


def flag_in(table: Mapping[str, Any], key: str, place: str) -> bool:
    """Return the true or false that a table holds, false where the key is left out.

    Raises:
        RobotError: the table holds something else there.
    """
    value = table.get(key, False)
    if not isinstance(value, bool):
        raise RobotError(f"{place}: {key}: true or false expected, got {value!r}.")
    return value


def number_in(entry: Any, unit: str, place: str) -> float:
    """Return the SI value of one number; arguments and errors as for `numbers_in`."""
    value = numbers_in(entry, unit, place)
    if value.ndim != 0:
        raise RobotError(f"{place}: one number expected, got {value.tolist()}.")
    return float(value)


def numbers_in(entry: Any, unit: str, place: str) -> FloatArray:
    """Return the SI values (...) of numbers, or of a table {value, unit, source} of them.

    Args:
        entry: what the TOML file holds.
        unit: SI unit expected, and meant where none is stated.
        place: file and key, for the message.

    Raises:
        RobotError: no number, an unknown key or unit, or a unit of another quantity.
    """
    if isinstance(entry, Mapping):
        check_keys(entry, _NUMBER_KEYS, place)
        if "value" not in entry:
            raise RobotError(f"{place}: the key 'value' is missing.")
        given, stated = entry["value"], str(entry.get("unit", unit))
    else:
        given, stated = entry, unit
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
