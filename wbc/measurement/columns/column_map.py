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

A line such as `time.unit = "ms"` or `columns."hip.velocity".sign = -1` means the same wherever it
stands, also below another heading (see `map_table.gathered`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wbc.errors import LogError, unknown_name
from wbc.measurement.columns.column_rule import ColumnRule, parse_rule
from wbc.measurement.columns.map_table import column_entries, gathered, read_table
from wbc.measurement.columns.row_choice import RowChoice, parse_rows
from wbc.measurement.columns.time_rule import TimeRule, parse_time

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
    return parse_column_map(read_table(path), str(Path(path)), gear_ratios)


def parse_column_map(
    table: Mapping[str, Any], path: str = "", gear_ratios: Mapping[str, float] | None = None
) -> ColumnMap:
    """Return the map that a parsed TOML table states (see `read_column_map`)."""
    label = path or "column map"
    table = gathered(table)
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
    entries = list(column_entries(table, label).items())
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
