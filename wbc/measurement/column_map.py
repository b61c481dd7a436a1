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

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import translate
from math import inf, isfinite
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import LogError, require_known
from wbc.files import SCHEMA, load_table, write_text
from wbc.measurement.schema import (
    LOG_UNITS,
    TIME,
    column_units,
    named_unit,
    not_a_column,
    split_column,
    today,
    unit_factor,
)

Mend: TypeAlias = Mapping[str, Any]
"""A map as a table. Its sources are channels of the log as it was read where it mends a log, for
example `{"columns": {"hip.velocity": {"sign": -1}}}`."""

_BARE = re.compile(r"[A-Za-z0-9_-]+")
ENCODER_RATES = {
    "position": "",
    "velocity": "/s",
    "acceleration": "/s^2",
    "target_position": "",
    "target_velocity": "/s",
}
"""Quantities that turn with the encoder of a joint -> what their unit has more than its."""
_MISSING = ("when_needed", "drop_rows", "bridge")
SECTIONS = ("rows", "time", "columns", "trusted")
_SIDES = ("rotor", "motor", "joint")
_POWERS = {
    **dict.fromkeys(ENCODER_RATES, -1),
    **dict.fromkeys(("rotor_position", "rotor_velocity", "rotor_torque"), 0),
    "motor_torque": 1,
}
"""Quantity of a log -> power of N by which a value on the rotor becomes it: psi = phi / N and
motor torque = N rotor torque."""


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
        """Return the channel, (N,), from the foreign columns, each (N,)."""
        total = np.zeros_like(sources[self.sources[0]])
        for factor, source in zip(self.factors, self.sources, strict=True):
            total = total + factor * self._counted(sources[source])
        return np.asarray(total + self.offset)

    def _counted(self, values: FloatArray) -> FloatArray:
        """Return a source without its empty cells (NaN), its bit of sign and its jumps."""
        if self.empty is not None:
            values = np.where(values == self.empty, np.nan, values)
        if self.sign_bit:
            limit = float(1 << self.sign_bit)
            values = np.where(values >= limit, limit - values, values)
        if self.unwrap > 0.0:
            known = np.isfinite(values)
            values = values.copy()
            values[known] = np.unwrap(values[known], period=self.unwrap)
            # Whole periods are free: the motion lies about zero, wherever the first row fell.
            middle = 0.5 * (np.nanmin(values) + np.nanmax(values)) if known.any() else 0.0
            values -= self.unwrap * np.round(middle / self.unwrap)
        return values


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
    target = today(target)
    units = column_units(target)
    parts = split_column(target)
    if units is None or parts is None:
        above = target.partition(".")[0] in SECTIONS
        hint = " Lines of other sections stand above the first [heading]." if above else ""
        raise LogError(f"{place}: {not_a_column(target)}{hint}")
    said = _section(_as_table(entry), _RULE, place)
    sources = _listed(said.pop("from", target))
    factor = said.pop("scale", 1.0) * said.pop("sign", 1.0)
    if factor == 0.0:
        raise LogError(f"{place}: scale and sign must not be 0.")
    if "unit" in said:
        factor *= unit_factor(said.pop("unit"), units, f"{place}.unit")
    weights = _per_source(said.pop("weights", 1.0), len(sources), f"{place}.weights")
    side, gear_ratio = said.pop("side", ""), said.pop("gear_ratio", None)
    sides = np.ones(len(sources))
    if side:
        given = ratios.get(parts[0]) if gear_ratio is None else gear_ratio
        gears = _per_source(given, len(sources), f"{place}.gear_ratio")
        sides = np.array([_side_factor(side, parts[1], N, place) for N in gears])
    elif gear_ratio is not None:
        raise LogError(f"{place}: gear_ratio without side; add side = rotor, motor or joint.")
    factors = tuple(float(f) for f in factor * np.asarray(weights) * sides)
    return ColumnRule(target, sources, factors, **said)


Key: TypeAlias = tuple[Callable[[Any], bool], str]
"""Whether a value fits a key of a map, and what is expected there."""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(isfinite(value))


def _is_list(value: Any, of: Callable[[Any], bool] = _is_number) -> bool:
    return isinstance(value, list) and bool(value) and all(map(of, value))


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _one_of(*words: str) -> Key:
    return lambda value: value in words, f"one of {', '.join(words)} is expected"


_TEXT: Key = _is_text, "a text is expected"
_NUMBER: Key = _is_number, "a finite number is expected"
_FLAG: Key = lambda value: isinstance(value, bool), "true or false is expected"
_NAMES: Key = (
    lambda value: _is_text(value) or _is_list(value, _is_text),
    "the name of a foreign column is needed, or a list of names",
)
_NUMBERS: Key = lambda value: _is_number(value) or _is_list(value), "numbers are expected"
_PATTERNS: Key = (
    lambda value: isinstance(value, Mapping) and all(map(_is_text, value.values())),
    "a table of column = pattern is expected",
)
_SPAN: Key = (
    lambda value: _is_list(value) and len(value) == 2 and value[0] < value[1],
    "[first, last] in seconds is expected",
)
_RULE: Mapping[str, Key] = {
    **{"from": _NAMES, "unit": _TEXT, "scale": _NUMBER, "sign": _NUMBER, "offset": _NUMBER},
    **{"weights": _NUMBERS, "side": _one_of(*_SIDES), "gear_ratio": _NUMBERS, "unwrap": _NUMBER},
    **{"sign_bit": (lambda value: isinstance(value, int), "the number of a bit is expected")},
    **{"lag": _NUMBER, "empty": _NUMBER, "missing": _one_of(*_MISSING)},
}
_TIME: Mapping[str, Key] = {
    **{"from": _TEXT, "unit": _TEXT, "rate": _NUMBER, "offset": _NUMBER},
    **{"repeated": _one_of("error", "first", "spread"), "align_velocity": _FLAG},
}
_ROWS: Mapping[str, Key] = {
    **{"split": _TEXT, "where": _PATTERNS, "between": _SPAN, "topic": _TEXT, "header": _NAMES}
}


def _section(table: Any, keys: Mapping[str, Key], place: str, example: str = "") -> dict[str, Any]:
    """Return a table after checking that its keys are known and their values fit."""
    if not isinstance(table, Mapping):
        raise LogError(f"{place}: a table is expected, such as {example}.")
    for key, value in table.items():
        require_known(LogError, "key", key, keys, place)
        fits, expected = keys[key]
        if not fits(value):
            raise LogError(f"{place}.{key}: {expected}, got {value!r}.")
    return dict(table)


def _listed(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, list) else (value,)


def _per_source(value: Any, count: int, place: str) -> list[float]:
    """Return a number for each of some columns; one number is that of all."""
    if value is None:
        raise LogError(
            f"{place}: side needs the gear ratio; add gear_ratio = N, or load with the robot whose "
            "gears are meant."
        )
    numbers = value if isinstance(value, list) else [value] * count
    if len(numbers) != count:
        raise LogError(f"{place}: {len(numbers)} numbers for {count} foreign columns.")
    if place.endswith("gear_ratio") and 0.0 in numbers:
        raise LogError(f"{place}: a ratio of 0 is no gear.")
    return numbers


def _side_factor(side: str, quantity: str, gear_ratio: float, place: str) -> float:
    """Return by what to multiply a value on `side` to get `quantity` of a log.

    `motor` and `joint` are one side here: where a topology D mixes motors into joints, name the
    columns of all of them with `weights`.

    Raises:
        LogError: a quantity for which a side means nothing.
    """
    if quantity not in _POWERS:
        raise LogError(
            f"{place}.side: a {quantity} has no side of the gear; leave the key out (use scale for "
            "a plain factor)."
        )
    behind = -1 if quantity.endswith("torque") else 1
    return float(gear_ratio ** (_POWERS[quantity] + (0 if side == "rotor" else behind)))


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
    said = _section(table, _TIME, place, 'time.from = "t"')
    if "rate" in said and ("from" in said or said["rate"] <= 0.0):
        raise LogError(f"{place}: give either from, or a rate above 0 [Hz].")
    factor = unit_factor(said.pop("unit", "s"), ("s",), f"{place}.unit")
    return TimeRule(said.pop("from", "" if "rate" in said else TIME), factor, **said)


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
            matches = re.compile(translate(pattern)).match
            values, inverse = np.unique(keys[column], return_inverse=True)
            kept &= np.array([matches(str(value)) is not None for value in values])[inverse]
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
    for key in table:
        require_known(LogError, "section", key, SECTIONS, label)
    columns = table.get("columns", {})
    if not isinstance(columns, Mapping):
        raise LogError(
            f'{label}: columns: a table is expected, such as columns."hip.position" = "q1".'
        )
    entries = list(column_entries(table, label).items())
    rows = _section(table.get("rows", {}), _ROWS, f"{label}: rows", 'rows.split = "log"')
    rows |= {"header": _listed(rows["header"])} if "header" in rows else {}
    trusted = _section({"trusted": table.get("trusted", False)}, {"trusted": _FLAG}, label)
    rules = [
        parse_rule(name, entry, f"{label}: columns.{name}", gear_ratios or {})
        for name, entry in entries
        if entry is not False
    ]
    return ColumnMap(
        rules=tuple(rules),
        time=parse_time(table.get("time", {}), f"{label}: time"),
        rows=RowChoice(**rows),
        path=path,
        left_out=tuple(name for name, entry in entries if entry is False),
        trusted=trusted["trusted"],
    )


def read_table(path: str | Path | None) -> dict[str, Any]:
    """Return a column map as a table; an empty one for None.

    Raises:
        LogError: no such file, or no TOML.
    """
    hint = (
        ' Each key stands once; lines such as time.unit = "ms" stand above the first [heading]. '
        "Option --fix of `wbc check` writes what it found together with the map in use."
    )
    return {} if path is None else load_table(path, "the column map", LogError, hint=hint)


def merged(first: Mend, second: Mend) -> dict[str, Any]:
    """Return the map that reads a file as `first` says, and then mends the log as `second` says.

    Args:
        first: a parsed column map, or an empty table.
        second: a mend of the log that `first` gives.
    """
    result = dict(first)
    for section, content in second.items():
        if section == "columns":
            result["columns"] = _columns(column_entries(first), column_entries(second))
        elif isinstance(content, Mapping):
            result[section] = {**result.get(section, {}), **content}
        else:
            result[section] = content
    return result


def together(mends: Iterable[Mend]) -> dict[str, Any]:
    """Return one mend that holds all of several; what several logs say alike is done once."""
    result: dict[str, Any] = {}
    said: list[tuple[str, str, Any]] = []
    for mend in mends:
        new = [(s, key, own) for s, content in mend.items() for key, own in content.items()]
        fresh = [one for one in new if one not in said]
        said += fresh
        for section in dict.fromkeys(section for section, _, _ in fresh):
            once = {key: own for s, key, own in fresh if s == section}
            result = merged(result, {section: once})
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
            raise LogError(
                f"{label}: columns.{name}: give the foreign name, a table such as "
                '{ unit = "deg" }, or false to leave the column out.'
            )


def _is_rule(name: str, value: Any) -> bool:
    """Whether a table is an entry, and not what unquoted names with dots nest."""
    if not isinstance(value, Mapping):
        return False
    known = bool(value) and set(value) <= set(_RULE)
    return known or split_column(name) is not None or "from" in value


def _columns(before: Mapping[str, Any], mend: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of [columns] that first read and then mend."""
    mends = {name: entry if entry is False else _as_table(entry) for name, entry in mend.items()}
    sources = {name: str(own.get("from", name)) for name, own in mends.items() if own is not False}
    entries = {name: entry for name, entry in before.items() if name not in sources.values()}
    for name, own in mends.items():
        if own is False:
            entries[name] = False
            continue
        old = _as_table(before.get(sources[name]) or {})
        entry = _combined(old, own)
        if entry.get("from", name) != name or sources[name] != name:
            rest = {key: value for key, value in entry.items() if key != "from"}
            entry = {"from": old.get("from", sources[name]), **rest}
        entries[name] = entry
    return entries


def _as_table(entry: Any) -> Any:
    """Return an entry that names its source alone as the table that says the same."""
    return {"from": entry} if isinstance(entry, str) else entry


def _combined(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    entry: dict[str, Any] = {**old, **{key: value for key, value in new.items() if key != "from"}}
    for key in ("sign", "scale"):
        if key in old and key in new:
            entry[key] = old[key] * new[key]
    if "unwrap" in new and ("unit" in old or "scale" in old):
        # The period is counted in the unit of the file, the mend in that of the log.
        worth = LOG_UNITS[named_unit(str(old["unit"]))][1] if "unit" in old else 1.0
        entry["unwrap"] = float(f"{new['unwrap'] / abs(worth * old.get('scale', 1.0)):.10g}")
    if "sign" in entry and entry["sign"] == 1:
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
        if not isinstance(content, Mapping):
            found.append(f"{_key(section)} = {_value(content)}")
            continue
        for key, value in content.items():
            found.append(f"{_key(section)}.{_key(key)} = {_value(value)}")
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
    return key if _BARE.fullmatch(key) else _value(key)


def _value(value: Any) -> str:
    """Return a TOML value on one line."""
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items())
        return "{ " + inner + " }" if inner else "{}"
    return json.dumps(value, ensure_ascii=False)  # TOML writes texts, numbers and lists alike
