"""Units that a column map may name, and what they are worth in the unit of the log."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import pi

from wbc.errors import LogError, unknown_name
from wbc.robot.loading.units import SI_UNITS

_TURN = 2.0 * pi

LOG_UNITS: dict[str, tuple[str, float]] = {
    **SI_UNITS,
    "turn": ("rad", _TURN),
    "mrad": ("rad", 1e-3),
    "um": ("m", 1e-6),
    "mm/s": ("m/s", 1e-3),
    "m/s": ("m/s", 1.0),
    "mrad/s": ("rad/s", 1e-3),
    "deg/s": ("rad/s", pi / 180.0),
    "turn/s": ("rad/s", _TURN),
    "rad/s^2": ("rad/s^2", 1.0),
    "deg/s^2": ("rad/s^2", pi / 180.0),
    "mm/s^2": ("m/s^2", 1e-3),
    "kN": ("N", 1e3),
    "mN": ("N", 1e-3),
    "kN m": ("N m", 1e3),
    "N cm": ("N m", 1e-2),
    "N mm": ("N m", 1e-3),
    "mA": ("A", 1e-3),
    "mV": ("V", 1e-3),
    "%": ("1", 1e-2),
    "us": ("s", 1e-6),
    "ns": ("s", 1e-9),
    "min": ("s", 60.0),
    "deg C": ("deg C", 1.0),
}
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
    known = named_unit(unit)
    if not known:
        fitting = [name for name, (kind, _) in LOG_UNITS.items() if kind in allowed]
        raise LogError(f"{place}: " + unknown_name("unit", unit, fitting))
    kind, factor = LOG_UNITS[known]
    if kind not in allowed:
        raise LogError(
            f"{place}: unit '{unit}' measures [{kind}], the column needs [{' or '.join(allowed)}]."
        )
    return factor
