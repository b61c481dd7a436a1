"""Reading tables of a description: keys, numbers with their units."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import pi
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import RobotError, require_known

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
    "rad/m": ("1", 1.0),  # of a slide's gear
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
