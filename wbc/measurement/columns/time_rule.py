"""The clock of a foreign file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from wbc.errors import LogError, unknown_name
from wbc.measurement.columns.units import unit_factor
from wbc.measurement.schema import TIME

TIME_KEYS = ("from", "rate", "unit", "offset", "repeated", "align_velocity")
_REPEATED = ("error", "first")


@dataclass(frozen=True)
class TimeRule:
    """time = factor source + offset [s], or row number / rate + offset.

    Attributes:
        source: column of the time stamps, empty when `rate` counts rows instead.
        factor: seconds per unit of the source.
        rate: rows per second of a file without a clock; 0 for none.
        offset: added at the end [s].
        repeated: `error`, or `first` to keep the first of several rows with one time stamp.
        align_velocity: whether the delay of the velocities is taken out (see `align_velocity`).
    """

    source: str = TIME
    factor: float = 1.0
    rate: float = 0.0
    offset: float = 0.0
    repeated: str = "error"
    align_velocity: bool = False


def parse_time(table: Any, place: str) -> TimeRule:
    """Return the time rule that the section [time] of a map states.

    Raises:
        LogError: a key, unit or number that does not fit.
    """
    if not isinstance(table, Mapping):
        raise LogError(f'{place}: a table is expected, such as time.from = "t".')
    for key in table:
        if key not in TIME_KEYS:
            raise LogError(f"{place}: " + unknown_name("key", key, TIME_KEYS))
    for key in ("rate", "offset"):
        value = table.get(key, 0.0)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise LogError(f"{place}.{key}: {value!r} is not a number.")
    if "rate" in table and ("from" in table or table["rate"] <= 0):
        raise LogError(f"{place}: give either from, or a rate above 0 [Hz].")
    repeated = str(table.get("repeated", "error"))
    if repeated not in _REPEATED:
        raise LogError(f"{place}.repeated: " + unknown_name("choice", repeated, _REPEATED))
    align = table.get("align_velocity", False)
    if not isinstance(align, bool):
        raise LogError(f"{place}.align_velocity: true or false expected, got {align!r}.")
    return TimeRule(
        source="" if "rate" in table else str(table.get("from", TIME)),
        factor=unit_factor(str(table.get("unit", "s")), ("s",), f"{place}.unit"),
        rate=float(table.get("rate", 0.0)),
        offset=float(table.get("offset", 0.0)),
        repeated=repeated,
        align_velocity=align,
    )
