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
    repeated = "first"                # keep the first of rows with one time stamp; default error
    align_velocity = true             # take the delay of the velocities out

    [columns]
    "hip.position" = "q1"             # SI and joint side already
    "hip.velocity" = { from = "w1", unit = "rpm", side = "rotor", gear_ratio = 20, sign = -1 }
    "knee.velocity" = { sign = -1 }   # of the column of that name
    "knee.acceleration" = false       # left out

Keys of a column: `from` (one name or several with `weights`; default the entry's own name), `unit`,
`scale`, `sign`, `side` and `gear_ratio`, `offset` (added last, in the unit of the log), `unwrap`
(period of the jumps, in the foreign unit), `missing` (when_needed, error, omit, drop_rows),
`optional`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wbc.errors import LogError, unknown_name
from wbc.measurement.columns.column_rule import RULE_KEYS, ColumnRule, parse_rule
from wbc.measurement.columns.row_choice import RowChoice, parse_rows
from wbc.measurement.columns.time_rule import TimeRule, parse_time
from wbc.measurement.schema import is_column

_SECTIONS = ("rows", "time", "columns", "trusted")


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

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of the channels that the map gives."""
        return tuple(rule.target for rule in self.rules)


def read_column_map(path: str | Path, gear_ratios: Mapping[str, float] | None = None) -> ColumnMap:
    """Read a column map.

    Args:
        path: the TOML file.
        gear_ratios: N of joints, for entries that name a side of the gear and no ratio.

    Raises:
        LogError: no such file, no TOML, or an entry that does not fit; the message names the map
            file and the key.
    """
    file = Path(path)
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as cause:
        raise LogError(f"cannot read the column map '{file}': {cause}.") from cause
    return parse_column_map(table, str(file), gear_ratios)


def parse_column_map(
    table: Mapping[str, Any], path: str = "", gear_ratios: Mapping[str, float] | None = None
) -> ColumnMap:
    """Return the map that a parsed TOML table states (see `read_column_map`)."""
    label = path or "column map"
    for key in table:
        if key not in _SECTIONS:
            raise LogError(f"{label}: " + unknown_name("section", key, _SECTIONS))
    columns = table.get("columns", {})
    if not isinstance(columns, Mapping):
        raise LogError(
            f'{label}: columns: a table is expected, such as columns."hip.position" = "q1".'
        )
    trusted = table.get("trusted", False)
    if not isinstance(trusted, bool):
        raise LogError(f"{label}: trusted: true or false expected, got {trusted!r}.")
    entries = list(_entries(columns, "", label))
    rules = [
        parse_rule(name, entry, f"{label}: columns.{name}", gear_ratios or {})
        for name, entry in entries
        if entry is not False
    ]
    return ColumnMap(
        rules=tuple(rules),
        time=parse_time(table.get("time", {}), f"{label}: time"),
        rows=parse_rows(table.get("rows", {}), f"{label}: rows"),
        path=path,
        left_out=tuple(name for name, entry in entries if entry is False),
        trusted=trusted,
    )


def column_entries(table: Mapping[str, Any], label: str = "column map") -> dict[str, Any]:
    """Return the entries of [columns] by the full name of their column.

    Raises:
        LogError: an entry that is neither a name nor a table.
    """
    return dict(_entries(table.get("columns", {}), "", label))


def _entries(table: Mapping[str, Any], prefix: str, label: str) -> Iterator[tuple[str, Any]]:
    """Yield (column name, entry); unquoted TOML keys with dots arrive as nested tables.

    A printed line names its section, `columns."hip.position" = ...`. Pasted below the heading
    `[columns]` it says so twice, and means the same.
    """
    for key, value in table.items():
        if key == "columns" and not prefix and isinstance(value, Mapping):
            yield from _entries(value, "", label)
            continue
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
    return is_column(name) or "from" in value or (bool(value) and set(value) <= set(RULE_KEYS))
