"""One line of a column map: how a channel of a log follows from columns of a foreign file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError, unknown_name
from wbc.measurement.columns.gear_side import side_factor
from wbc.measurement.columns.units import unit_factor
from wbc.measurement.schema import column_units, likely_meant, split_column

RULE_KEYS = (
    "from",
    "unit",
    "scale",
    "sign",
    "offset",
    "weights",
    "side",
    "gear_ratio",
    "unwrap",
    "missing",
    "optional",
)
_MISSING = ("when_needed", "error", "omit", "drop_rows")


@dataclass(frozen=True)
class ColumnRule:
    """value = sum_k factor_k source_k + offset, in the unit of the log.

    Attributes:
        target: name of the channel in the log.
        sources: columns of the foreign file.
        factors: one per source: unit, scale, sign, weight and gear in one number.
        offset: added at the end, in the unit of the log.
        unwrap: period of the sources' jumps, in their own unit; 0 for none.
        missing: what to do with NaN: leave the channel out and refuse it `when_needed`, refuse the
            file (`error`), `omit` the channel if it is NaN throughout, or `drop_rows`.
        optional: whether the file may lack the sources (the channel is then left out).
        implied: whether the map named no source, so that the file's own column of the target's
            name is meant.
    """

    target: str
    sources: tuple[str, ...]
    factors: tuple[float, ...]
    offset: float = 0.0
    unwrap: float = 0.0
    missing: str = "when_needed"
    optional: bool = False
    implied: bool = False

    def value(self, sources: Mapping[str, FloatArray]) -> FloatArray:
        """Return the channel, (N,), from the (unwrapped) foreign columns, each (N,)."""
        total: FloatArray = np.asarray(self.factors[0] * sources[self.sources[0]])
        for factor, source in zip(self.factors[1:], self.sources[1:], strict=True):
            total = total + factor * sources[source]
        return total + self.offset


def identity_rule(name: str) -> ColumnRule:
    """Return the rule of a column that already has its name and unit."""
    return ColumnRule(name, (name,), (1.0,))


def parse_rule(target: str, entry: Any, place: str, ratios: Mapping[str, float]) -> ColumnRule:
    """Return the rule that a map's entry states.

    Args:
        target: name of the channel, the key of the entry.
        entry: the foreign name alone, or a table with the keys of this module; without `from` the
            file's column of the target's own name is meant.
        place: map file and key, for messages.
        ratios: gear ratio N of joints, where an entry does not give its own.

    Raises:
        LogError: a key, name, unit, side or number that does not fit.
    """
    units = column_units(target)
    parts = split_column(target)
    if units is None or parts is None:
        meant = likely_meant(target)
        hint = f" Did you mean '{meant}'?" if meant else ""
        raise LogError(f"{place}: '{target}' is not a column of a log.{hint}")
    table: Mapping[str, Any] = {"from": entry} if isinstance(entry, str) else entry
    for key in table:
        if key not in RULE_KEYS:
            raise LogError(f"{place}: " + unknown_name("key", key, RULE_KEYS))
    sources = _names(table.get("from", target), f"{place}.from")
    factor = _number(table, "scale", 1.0, place) * _number(table, "sign", 1.0, place)
    if factor == 0.0:
        raise LogError(f"{place}: scale and sign must not be 0.")
    if "unit" in table:
        factor *= unit_factor(str(table["unit"]), units, f"{place}.unit")
    weights = _per_source(table, "weights", 1.0, len(sources), place)
    sides = np.ones(len(sources))
    if "side" in table:
        given = ratios.get(parts[0])
        gears = _per_source(table, "gear_ratio", given, len(sources), place)
        sides = np.array([side_factor(str(table["side"]), parts[1], N, place) for N in gears])
    elif "gear_ratio" in table:
        raise LogError(f"{place}: gear_ratio without side; add side = rotor, motor or joint.")
    missing = str(table.get("missing", "when_needed"))
    if missing not in _MISSING:
        raise LogError(f"{place}.missing: " + unknown_name("choice", missing, _MISSING))
    return ColumnRule(
        target=target,
        sources=sources,
        factors=tuple(float(f) for f in factor * np.asarray(weights) * sides),
        offset=_number(table, "offset", 0.0, place),
        unwrap=_number(table, "unwrap", 0.0, place),
        missing=missing,
        optional=bool(table.get("optional", False)),
        implied="from" not in table,
    )


def _names(value: Any, place: str) -> tuple[str, ...]:
    names = (value,) if isinstance(value, str) else value
    if not isinstance(names, list | tuple) or not names:
        raise LogError(f"{place}: the name of a foreign column is needed, or a list of names.")
    return tuple(str(name) for name in names)


def _number(table: Mapping[str, Any], key: str, default: float, place: str) -> float:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise LogError(f"{place}.{key}: {value!r} is not a finite number.")
    return float(value)


def _per_source(
    table: Mapping[str, Any], key: str, default: float | None, count: int, place: str
) -> list[float]:
    value = table.get(key, default)
    if value is None:
        raise LogError(
            f"{place}: side needs the gear ratio; add gear_ratio = N, or load with the robot whose "
            "gears are meant."
        )
    values = value if isinstance(value, list) else [value] * count
    if len(values) != count:
        raise LogError(f"{place}.{key}: {len(values)} numbers for {count} foreign columns.")
    numbers = [_number({key: v}, key, 0.0, place) for v in values]
    if key == "gear_ratio" and 0.0 in numbers:
        raise LogError(f"{place}.gear_ratio: a ratio of 0 is no gear.")
    return numbers
