"""The column names of a log, what they mean, and the units in which they stand or may be given."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from math import pi

from wbc.errors import LogError, unknown_name
from wbc.robot.description import SI_UNITS

TIME = "time"

JOINT_QUANTITIES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("position", "target_position", "goal_position"), ("rad", "m")),
    **dict.fromkeys(("velocity", "target_velocity"), ("rad/s", "m/s")),
    **dict.fromkeys(("rotor_torque", "motor_torque", "joint_torque"), ("N m", "N")),
    **dict.fromkeys(("duty", "enabled"), ("1",)),
    **{"acceleration": ("rad/s^2", "m/s^2"), "current": ("A",), "rotor_position": ("rad",)},
    **{"rotor_velocity": ("rad/s",), "temperature": ("deg C",), "voltage": ("V",)},
}
"""Quantity of `<joint>.<quantity>` and its units (rotary, linear).

`rotor_torque` acts on the rotor, `motor_torque` = N rotor_torque is the same after the reduction,
`joint_torque` comes from a sensor at the output. `voltage` is the supply of the drive, `duty` the
share of it on the winding (-1 to 1), `enabled` is 1 while the drive is powered and 0 while the
winding is open, `target_position` and `target_velocity` the set point of a position drive;
`goal_position` is the old name of `target_position`.
"""

REPORTED = ("rotor_torque", "motor_torque", "current")
"""Quantities that a drive reports its torque by."""

OLD_NAMES = {"goal_position": "target_position"}
"""Quantity by its old name -> by its name of today."""

FORCE_QUANTITIES: dict[str, tuple[str, ...]] = {f"force.{axis}": ("N",) for axis in "xyz"}
"""Quantity of `<contact>.<quantity>`: force of the ground on the robot, world frame."""

CONTACT_QUANTITIES: dict[str, tuple[str, ...]] = {**FORCE_QUANTITIES, "active": ("1",)}
"""Quantity of `<contact>.<quantity>`: its force, or `active`, 1 while it touches and else 0."""

FREE_POSE: dict[str, tuple[str, ...]] = {
    **{f"position.{axis}": ("m",) for axis in "xyz"},
    **{f"orientation.{axis}": ("1",) for axis in "xyzw"},
}
"""Quantity of `base.<quantity>` and `<free body>.<quantity>`, in the order of a free-flyer's q."""

FREE_VELOCITY: dict[str, tuple[str, ...]] = {
    **{f"linear_velocity.{axis}": ("m/s",) for axis in "xyz"},
    **{f"angular_velocity.{axis}": ("rad/s",) for axis in "xyz"},
}
"""The same in the order of v, in the body frame."""

_QUANTITIES = {**JOINT_QUANTITIES, **CONTACT_QUANTITIES, **FREE_POSE, **FREE_VELOCITY}


def split_column(name: str) -> tuple[str, str] | None:
    """Return (owner, quantity) of a column of the schema, None for any other name.

    The owner is a joint, a contact, `base` or a free body; its name may itself hold dots.
    """
    for quantity in _QUANTITIES:
        owner = name.removesuffix(f".{quantity}")
        if owner not in (name, ""):
            return owner, quantity
    return None


def column_units(name: str) -> tuple[str, ...] | None:
    """Return the SI units a column may have, None for a name that is not in the schema."""
    parts = split_column(name)
    return ("s",) if name == TIME else _QUANTITIES[parts[1]] if parts else None


def is_column(name: str) -> bool:
    """Whether `name` is `time` or a column of the schema."""
    return column_units(name) is not None


def likely_meant(name: str) -> str | None:
    """Return the schema column that `name` looks like a misspelling of, None if there is none."""
    if is_column(name):
        return None
    if get_close_matches(name.lower(), [TIME], cutoff=0.85):
        return TIME
    owner, dot, last = name.rpartition(".")
    near = get_close_matches(last.lower(), JOINT_QUANTITIES, n=1, cutoff=0.8) if dot else []
    return f"{owner}.{near[0]}" if near else None


def not_a_column(name: str) -> str:
    """Return the message for a name that is none of the schema."""
    hint = f" Did you mean '{meant}'?" if (meant := likely_meant(name)) else ""
    others = "<contact>.force.x|y|z or active; base.<quantity> (time is separate)."
    names = f"<joint>.<quantity> with {', '.join(JOINT_QUANTITIES)}; {others}"
    return f"'{name}' is not a column of a log.{hint} Names are {names}"


def today(name: str) -> str:
    """Return the name that a column has today: a log is written and asked by its old one, too."""
    owner, _, quantity = name.rpartition(".")
    return f"{owner}.{OLD_NAMES[quantity]}" if quantity in OLD_NAMES else name


def owners(names: Iterable[str], quantities: Iterable[str]) -> tuple[str, ...]:
    """Return who owns a column of one of `quantities`, in order of first appearance."""
    parts, wanted = map(split_column, names), set(quantities)
    return tuple(dict.fromkeys(part[0] for part in parts if part and part[1] in wanted))


def reported(names: Iterable[str]) -> list[str]:
    """Return the columns by which drives report their torque."""
    return [name for name in names if name.rpartition(".")[2] in REPORTED]


_TURN, _DEGREE = 2.0 * pi, pi / 180.0
_MORE_UNITS = {
    "rad": {"turn": _TURN, "rev": _TURN, "mrad": 1e-3},
    "m": {"um": 1e-6},
    "m/s": {"mm/s": 1e-3, "m/s": 1.0},
    "rad/s": {"mrad/s": 1e-3, "deg/s": _DEGREE, "turn/s": _TURN, "rev/s": _TURN},
    "rad/s^2": {"rad/s^2": 1.0, "deg/s^2": _DEGREE, "turn/s^2": _TURN},
    "m/s^2": {"mm/s^2": 1e-3},
    "N": {"kN": 1e3, "mN": 1e-3},
    "N m": {"kN m": 1e3, "N cm": 1e-2, "N mm": 1e-3},
    "A": {"mA": 1e-3},
    "V": {"mV": 1e-3},
    "1": {"%": 1e-2},
    "s": {"us": 1e-6, "ns": 1e-9, "min": 60.0},
    "deg C": {"deg C": 1.0},
}
LOG_UNITS: dict[str, tuple[str, float]] = dict(SI_UNITS)
LOG_UNITS |= {unit: (kind, own[unit]) for kind, own in _MORE_UNITS.items() for unit in own}
"""Unit -> (unit of the log, factor)."""


def named_unit(text: str) -> str:
    """Return the unit that a text names, also without blanks or in brackets, `[Nmm]`; else ''."""
    return _SPELT.get(_spelling(text), "")


def _spelling(text: str) -> str:
    return re.sub(r"[\s*·()\[\]]", "", text)


_SPELT = {_spelling(unit): unit for unit in LOG_UNITS}


def unit_factor(unit: str, allowed: Sequence[str], place: str) -> float:
    """Return what one `unit` is worth in the log's unit of the same kind.

    Args:
        unit: as the map names it.
        allowed: the units that the column may have in a log.
        place: map file and key, for the message.

    Raises:
        LogError: no such unit, or one of another kind of quantity.
    """
    if not (known := named_unit(unit)):
        fitting = [name for name, (kind, _) in LOG_UNITS.items() if kind in allowed]
        raise LogError(f"{place}: " + unknown_name("unit", unit, fitting))
    kind, factor = LOG_UNITS[known]
    if kind not in allowed:
        needed = f"the column needs [{' or '.join(allowed)}]"
        raise LogError(f"{place}: unit '{unit}' measures [{kind}], {needed}.")
    return factor
