"""Units that a robot description may use, and what they are worth in SI."""

from __future__ import annotations

from math import pi

from wbc.errors import RobotError, unknown_name

SI_UNITS: dict[str, tuple[str, float]] = {
    "1": ("1", 1.0),
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "rad": ("rad", 1.0),
    "deg": ("rad", pi / 180.0),
    "arcmin": ("rad", pi / 10800.0),
    "kg": ("kg", 1.0),
    "g": ("kg", 1e-3),
    "kg m^2": ("kg m^2", 1.0),
    "g cm^2": ("kg m^2", 1e-7),
    "kg cm^2": ("kg m^2", 1e-4),
    "N": ("N", 1.0),
    "N m": ("N m", 1.0),
    "mN m": ("N m", 1e-3),
    "rad/s": ("rad/s", 1.0),
    "rpm": ("rad/s", pi / 30.0),
    "N m s/rad": ("N m s/rad", 1.0),
    "N m s^2/rad^2": ("N m s^2/rad^2", 1.0),
    "N m/rad": ("N m/rad", 1.0),
    "N m/A": ("N m/A", 1.0),
    "ohm": ("ohm", 1.0),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "1/K": ("1/K", 1.0),
    "1/W": ("1/W", 1.0),
    "1/s": ("1/s", 1.0),
    "1/rad": ("1/rad", 1.0),
    "V": ("V", 1.0),
    "A": ("A", 1.0),
    "m/s^2": ("m/s^2", 1.0),
}


def to_si(value: float, unit: str, expected: str, place: str) -> float:
    """Return `value` in SI after checking that `unit` measures what is `expected`.

    Raises:
        RobotError: an unknown unit, or one of another quantity; `place` says where it stands.
    """
    if unit not in SI_UNITS:
        raise RobotError(f"{place}: " + unknown_name("unit", unit, SI_UNITS))
    dimension, factor = SI_UNITS[unit]
    if dimension != expected:
        raise RobotError(f"{place}: unit '{unit}' measures [{dimension}], expected [{expected}].")
    return value * factor
