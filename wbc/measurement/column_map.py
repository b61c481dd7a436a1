"""The column map: a TOML file that tells how a foreign file becomes a log.

A map is a patch. Columns of the file that already have the name of a channel pass through, except
those that an entry uses under another name; an entry says what is different.

    trusted = true                    # the columns hold what they say: suspicions only warn

    [rows]
    split = "log"                     # a column whose values tell the logs of one file apart
    where = { log = "A.0/*" }         # keep only rows whose columns match these patterns
    between = [0.0, 10.0]             # [s], after unit and offset of the time
    topic = "/joint_states"           # of a bag with several
    header = ["time", "hip.position"] # names of the columns of a CSV file without a header line

    [time]
    from = "time_ms"                  # or rate = 1000.0 [Hz] for a file without a clock
    unit = "ms"
    offset = 0.0                      # [s]
    repeated = "spread"               # rows with one time stamp lie evenly before the next one;
                                      # "first" keeps the first of them; default error
    align_velocity = true             # take the delay of the velocities out

    [columns]
    "hip.position" = "q1"             # SI and joint side already
    "hip.velocity" = { from = "w1", unit = "rpm", side = "rotor", gear_ratio = 20, sign = -1 }
    "knee.velocity" = { sign = -1 }   # of the column of that name
    "knee.acceleration" = false       # left out

Keys of a column: `from` (one name or several with `weights`; default the entry's own name), `unit`,
`scale`, `sign`, `side` and `gear_ratio`, `offset` (added last, in the unit of the log), `unwrap`
(period of the jumps, in the foreign unit), `sign_bit` (of counts whose sign is a bit: 15), `lag`
(by how much the column is late [s]), `empty` (a number that stands for no measurement), `missing`
(when_needed, drop_rows, bridge).

The same without headings, one line for each entry, is how `wbc init` and `--fix` write maps:
`time.unit = "ms"`, `columns."hip.velocity" = { sign = -1 }`.
"""

from __future__ import annotations

import fnmatch
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import inf, isfinite
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wbc.arrays import BoolArray, FloatArray, is_real
from wbc.errors import LogError, require_known
from wbc.files import SCHEMA, load_table, write_text
from wbc.measurement import schema

Mend: TypeAlias = Mapping[str, Any]
"""A map as a table. Its sources are channels of the log as it was read where it mends a log, for
example `{"columns": {"hip.velocity": {"sign": -1}}}`."""

ENCODER_RATES = {"position": "", "velocity": "/s", "acceleration": "/s^2"}
ENCODER_RATES |= {"target_position": "", "target_velocity": "/s"}
"""Quantities that turn with the encoder of a joint -> what their unit has more than its."""
SECTIONS: Mapping[str, Any] = {
    **{"rows": {"split": "log"}, "time": {"from": "t"}, "columns": {"hip.position": "q1"}},
    "trusted": True,
}
# Quantity of a log -> power of N by which a value on the rotor becomes it: psi = phi / N and motor
# torque = N rotor torque.
_POWERS = {
    **dict.fromkeys(ENCODER_RATES, -1),
    **dict.fromkeys(("rotor_position", "rotor_velocity", "rotor_torque"), 0),
    "motor_torque": 1,
}


_RULE: Mapping[str, Any] = {
    **{"from": ["q1"], "unit": "deg", "scale": 0.5, "sign": -1.0, "weights": [1.0], "offset": 0.5},
    **{"side": ("rotor", "motor", "joint"), "gear_ratio": [20.0], "unwrap": 360.0, "sign_bit": 15},
    **{"lag": 0.01, "empty": 0.0, "missing": ("when_needed", "drop_rows", "bridge")},
}
_TIME: Mapping[str, Any] = {
    **{"from": "t", "unit": "ms", "rate": 1000.0, "offset": 0.5, "align_velocity": True},
    "repeated": ("error", "first", "spread"),
}
# Key of a section -> what may stand there: a value like this one, or like those of the list, or one
# of the words.
_ROWS: Mapping[str, Any] = {
    **{"split": "log", "where": {"log": "A.0/*"}, "topic": "/joint_states", "header": ["time"]},
    "between": [0.0, 10.0],
}


def _checked(
    table: Mapping[str, Any], keys: Mapping[str, Any], place: str, kind: str = "key"
) -> dict[str, Any]:
    """Return a table after checking that its keys are known and their values fit."""
    for key, value in table.items():
        require_known(LogError, kind, key, keys, place)
        if not _fits(value, like := keys[key]):
            known = {str: "a text", float: "a finite number", bool: "true or false"}
            said = known.get(type(like), f"a value such as {like!r}")
            said = f"one of {', '.join(like)}" if isinstance(like, tuple) else said
            own = f"{place}.{key}" if kind == "key" else f"{place}: {key}"
            told = f"{said} is expected, got {value!r}"
            if isinstance(like, dict):
                told = f"a table is expected, such as {lines({key: like})[0]}"
            raise LogError(f"{own}: {told}.")
    return dict(table)


def _fits(value: Any, like: Any) -> bool:
    """Whether a value of a map is of the kind of another one; see `_RULE`."""
    if isinstance(like, tuple):
        return value in like
    if isinstance(like, list):
        return all(_fits(one, like[0]) for one in _listed(value)) and value != []
    if isinstance(like, float):
        return is_real(value) and isfinite(value)
    return isinstance(value, Mapping if isinstance(like, dict) else type(like))


def _listed(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, list) else (value,)


@dataclass(frozen=True)
class ColumnRule:
    """value = sum_k factor_k source_k + offset, in the unit of the log.

    Attributes:
        target: name of the channel in the log.
        sources: columns of the foreign file.
        factors: one per source: unit, scale, sign, weight and gear in one number.
        offset: added at the end, in the unit of the log.
        unwrap: period of the sources' jumps, in their own unit; 0 for none. Of the positions that
            differ by whole periods those nearest to zero are taken.
        sign_bit: number of the bit that is the sign of the sources' counts; 0 for none.
        lag: by how much the channel is late [s].
        empty: number of the sources that stands for no measurement; None for none.
        missing: what to do with NaN: leave the channel out and refuse it `when_needed`,
            `drop_rows`, or `bridge` them by straight lines.
    """

    target: str
    sources: tuple[str, ...]
    factors: tuple[float, ...]
    offset: float = 0.0
    unwrap: float = 0.0
    sign_bit: int = 0
    lag: float = 0.0
    empty: float | None = None
    missing: str = "when_needed"

    def value(self, sources: Mapping[str, FloatArray]) -> FloatArray:
        """Return the channel, (N,), from the foreign columns, each (N,).

        Cells that are empty become NaN, the bit of a sign becomes a sign, and jumps are undone.
        """
        total: FloatArray | float = self.offset
        for factor, name in zip(self.factors, self.sources, strict=True):
            values = np.where(sources[name] == self.empty, np.nan, sources[name])
            if self.sign_bit:
                limit = float(1 << self.sign_bit)
                values = np.where(values >= limit, limit - values, values)
            known = np.isfinite(values)
            if self.unwrap > 0.0 and known.any():
                values[known] = np.unwrap(values[known], period=self.unwrap)
                # Whole periods are free: the motion lies about zero, wherever the first row fell.
                middle = 0.5 * (np.nanmin(values) + np.nanmax(values))
                values -= self.unwrap * np.round(middle / self.unwrap)
            total = total + factor * values
        return np.asarray(total)


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
    target = schema.today(target)
    units, parts = schema.column_units(target), schema.split_column(target)
    if units is None or parts is None:
        above = target.partition(".")[0] in SECTIONS
        hint = " Lines of other sections stand above the first [heading]." if above else ""
        raise LogError(f"{place}: {schema.not_a_column(target)}{hint}")
    said = _checked(_as_table(entry), _RULE, place)
    sources = _listed(said.pop("from", target))
    factor = said.pop("scale", 1.0) * said.pop("sign", 1.0)
    if factor == 0.0:
        raise LogError(f"{place}: scale and sign must not be 0.")
    if "unit" in said:
        factor *= schema.unit_factor(said.pop("unit"), units, f"{place}.unit")
    numbers = factor * _per_source(said.pop("weights", 1.0), len(sources), f"{place}.weights")
    side, gears = said.pop("side", ""), said.pop("gear_ratio", ratios.get(parts[0]))
    if side:
        numbers *= _to_side(side, parts[1], gears, len(sources), place)
    elif "gear_ratio" in entry:
        raise LogError(f"{place}: gear_ratio without side; add side = rotor, motor or joint.")
    return ColumnRule(target, sources, tuple(map(float, numbers)), **said)


def _per_source(given: Any, count: int, place: str) -> FloatArray:
    """Return a number for each of some columns, (count,); one number is that of all."""
    numbers = np.array(_listed(given), dtype=np.float64)
    if numbers.size != count and isinstance(given, list):
        raise LogError(f"{place}: {numbers.size} numbers for {count} foreign columns.")
    return np.resize(numbers, count)


def _to_side(side: str, quantity: str, gears: Any, count: int, place: str) -> FloatArray:
    """Return by what to multiply values (count,) on a side of gears to get a quantity of a log.

    Motor and joint are one side: where D mixes motors into joints, weights name all of them.
    """
    if gears is None:
        way = "add gear_ratio = N, or load with the robot of these gears."
        raise LogError(f"{place}.gear_ratio: side needs the gear ratio; {way}")
    numbers = _per_source(gears, count, f"{place}.gear_ratio")
    if not numbers.all():
        raise LogError(f"{place}.gear_ratio: a ratio of 0 is no gear.")
    if quantity not in _POWERS:
        way = "leave the key out (use scale for a plain factor)."
        raise LogError(f"{place}.side: a {quantity} has no side of the gear; {way}")
    behind = 0 if side == "rotor" else -1 if quantity.endswith("torque") else 1
    return np.asarray(numbers ** (_POWERS[quantity] + behind))


@dataclass(frozen=True)
class TimeRule:
    """time = factor source + offset [s], or row number / rate + offset.

    Attributes:
        source: column of the time stamps, empty when `rate` counts rows instead.
        factor: seconds per unit of the source.
        rate: rows per second of a file without a clock; 0 for none.
        offset: added at the end [s].
        repeated: what to do with several rows of one time stamp: `error`, keep the `first`, or
            `spread` them evenly over the time until the next stamp.
        align_velocity: whether the delay of the velocities is taken out (see `align_velocity`).
    """

    source: str = schema.TIME
    factor: float = 1.0
    rate: float = 0.0
    offset: float = 0.0
    repeated: str = "error"
    align_velocity: bool = False


@dataclass(frozen=True)
class RowChoice:
    """Selection and partition of the rows of one file.

    Attributes:
        split: column whose values tell the logs of one file apart, empty if it holds one log; a
            value that comes back later begins a log of its own.
        where: column -> shell pattern (`*`, `?`) that its values must match.
        between: first and last time [s] of a log, on its own clock.
        topic: JointState topic of a bag, empty for the only one.
        header: names of the columns of a CSV file that has no header line.
    """

    split: str = ""
    where: Mapping[str, str] = field(default_factory=dict)
    between: tuple[float, float] = (-inf, inf)
    topic: str = ""
    header: tuple[str, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """The columns, read as text, that decide about a row."""
        return tuple(dict.fromkeys([*([self.split] if self.split else []), *self.where]))

    def keeps(self, keys: Mapping[str, Any], rows: int) -> BoolArray:
        """Return which of some rows match `where`, (rows,) bool; `keys` holds text columns."""
        kept = np.ones(rows, dtype=bool)
        for column, pattern in self.where.items():
            kept &= np.isin(keys[column], fnmatch.filter(np.unique(keys[column]), pattern))
        return kept


@dataclass(frozen=True)
class ColumnMap:
    """A parsed column map.

    Attributes:
        rules: one per channel of the log.
        time: how the time stamps are found.
        rows: which rows make a log, and where one log of a file ends and the next begins.
        path: the map file, empty for a map made in code.
        left_out: columns of the file that are not read.
        trusted: whether the user vouches for the columns, so that suspicions only warn.
    """

    rules: tuple[ColumnRule, ...]
    time: TimeRule = field(default_factory=TimeRule)
    rows: RowChoice = field(default_factory=RowChoice)
    path: str = ""
    left_out: tuple[str, ...] = ()
    trusted: bool = False


def parse_column_map(
    table: Mapping[str, Any], path: str = "", gear_ratios: Mapping[str, float] | None = None
) -> ColumnMap:
    """Return the map that a parsed TOML table states.

    Args:
        table: of the map.
        path: of its file, for messages.
        gear_ratios: N of joints, for entries that name a side of the gear and no ratio.

    Raises:
        LogError: an entry that does not fit; the message names the key.
    """
    label = path or "column map"
    _checked(table, SECTIONS, label, "section")
    rows = _checked(table.get("rows", {}), _ROWS, f"{label}: rows")
    rows |= {"header": _listed(rows["header"])} if "header" in rows else {}
    where = rows.get("where", {})
    _checked(where, dict.fromkeys(where, "A.0/*"), f"{label}: rows.where")
    if "between" in rows and not (len(span := rows["between"]) == 2 and span[0] < span[1]):
        raise LogError(f"{label}: rows.between: [first, last] in seconds is expected, got {span}.")
    time = _checked(table.get("time", {}), _TIME, f"{label}: time")
    if "rate" in time and ("from" in time or time["rate"] <= 0.0):
        raise LogError(f"{label}: time: give either from, or a rate above 0 [Hz].")
    factor = schema.unit_factor(time.pop("unit", "s"), ("s",), f"{label}: time.unit")
    source = time.pop("from", "" if "rate" in time else schema.TIME)
    entries = column_entries(table, label)
    rules = [
        parse_rule(name, entry, f"{label}: columns.{name}", gear_ratios or {})
        for name, entry in entries.items()
        if entry is not False
    ]
    return ColumnMap(
        rules=tuple(rules),
        time=TimeRule(source, factor, **time),
        rows=RowChoice(**rows),
        path=path,
        left_out=tuple(name for name, entry in entries.items() if entry is False),
        trusted=table.get("trusted", False),
    )


def read_table(path: str | Path | None) -> dict[str, Any]:
    """Return a column map as a table; an empty one for None.

    Raises:
        LogError: no such file, or no TOML.
    """
    hint = ' Each key stands once; lines such as time.unit = "ms" stand above the first [heading]. '
    hint += "Option --fix of `wbc check` writes what it found together with the map in use."
    return {} if path is None else load_table(path, "the column map", LogError, hint=hint)


def merged(first: Mend, second: Mend) -> dict[str, Any]:
    """Return the map that reads a file as `first` says, and then mends the log as `second` says.

    Args:
        first: a parsed column map, or an empty table.
        second: a mend of the log that `first` gives.
    """
    result = dict(first)
    for section, content in second.items():
        held = first.get(section, {})
        result[section] = {**held, **content} if isinstance(content, Mapping) else content
    if "columns" in second:
        result["columns"] = _columns(column_entries(first), column_entries(second))
    return result


def together(mends: Iterable[Mend]) -> dict[str, Any]:
    """Return one mend that holds all of several; what several logs say alike is done once."""
    result: dict[str, Any] = {}
    said: list[tuple[str, str, Any]] = []
    for mend in mends:
        for section, content in mend.items():
            fresh = {key: own for key, own in content.items() if (section, key, own) not in said}
            said += [(section, key, own) for key, own in fresh.items()]
            result = merged(result, {section: fresh}) if fresh else result
    return result


def column_entries(table: Mapping[str, Any], label: str = "column map") -> dict[str, Any]:
    """Return the entries of [columns] by the full name of their column.

    Raises:
        LogError: an entry that is neither a name nor a table.
    """
    return dict(_entries(table.get("columns", {}), "", label))


def _entries(table: Mapping[str, Any], prefix: str, label: str) -> Iterator[tuple[str, Any]]:
    """Yield (column name, entry); unquoted TOML keys with dots arrive as nested tables."""
    for key, value in table.items():
        name = f"{prefix}{key}"
        if isinstance(value, str) or value is False or _is_rule(name, value):
            yield name, value
        elif isinstance(value, Mapping) and value:
            yield from _entries(value, f"{name}.", label)
        else:
            ways = 'a table such as { unit = "deg" }, or false to leave the column out.'
            raise LogError(f"{label}: columns.{name}: give the foreign name, {ways}")


def _is_rule(name: str, value: Any) -> bool:
    """Whether a table is an entry, and not what unquoted names with dots nest."""
    keys, named = {*value} if isinstance(value, Mapping) else None, schema.split_column(name)
    return keys is not None and (bool(named) or "from" in keys or set() < keys <= {*_RULE})


def _columns(before: Mapping[str, Any], mend: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of [columns] that first read and then mend."""
    mends = {name: _as_table(entry) for name, entry in mend.items()}
    sources = {name: str(own.get("from", name)) for name, own in mends.items() if own is not False}
    entries = {name: entry for name, entry in before.items() if name not in sources.values()}
    for name, own in mends.items():
        entries[name] = False
        if own is not False:
            old = _as_table(before.get(sources[name]) or {})
            start = old.get("from", sources[name])
            entries[name] = {**({} if start == name else {"from": start}), **_combined(old, own)}
    return entries


def _as_table(entry: Any) -> Any:
    """Return an entry that names its source alone as the table that says the same."""
    return {"from": entry} if isinstance(entry, str) else entry


def _combined(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    entry: dict[str, Any] = {key: value for key, value in {**old, **new}.items() if key != "from"}
    for key in ("sign", "scale"):
        if key in old and key in new:
            entry[key] = old[key] * new[key]
    if "unwrap" in new and ("unit" in old or "scale" in old):
        # The period is counted in the unit of the file, the mend in that of the log.
        worth = schema.LOG_UNITS[schema.named_unit(str(old["unit"]))][1] if "unit" in old else 1.0
        entry["unwrap"] = float(f"{new['unwrap'] / abs(worth * old.get('scale', 1.0)):.10g}")
    if entry.get("sign") == 1:
        del entry["sign"]
    return entry


def say_so(mend: Mend, what: str = "say so") -> str:
    """Return how to do something in a column map, with the lines of the map that do it.

    The lines stand below the sentence, indented, so that they can be copied into a file; what
    follows them belongs on a new line.
    """
    return f"{what} in a column map (--columns MAP.toml):\n    " + "\n    ".join(lines(mend))


def lines(mend: Mend) -> list[str]:
    """Return a mend as lines of TOML that stand for themselves, one per entry."""
    found = []
    for section, content in mend.items():
        if isinstance(content, Mapping):
            found += [f"{_key(section)}.{_key(k)} = {_value(v)}" for k, v in content.items()]
        else:
            found.append(f"{_key(section)} = {_value(content)}")
    return found


def write_map(path: str | Path, table: Mend, comments: Iterable[str] = ()) -> Path:
    """Write a column map, a line for each entry and no headings: a printed line fits anywhere.

    Args:
        path: the TOML file.
        table: sections of the map.
        comments: lines that stand above it.
    """
    head = [f"# {line}" for text in comments for line in text.splitlines()]
    body = lines({"schema": SCHEMA, **table})
    return write_text(path, "\n".join([*head, *body]) + "\n")


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _value(key)


def _value(value: Any) -> str:
    """Return a TOML value on one line."""
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items())
        return "{ " + inner + " }" if inner else "{}"
    return json.dumps(value, ensure_ascii=False)  # TOML writes texts, numbers and lists alike
