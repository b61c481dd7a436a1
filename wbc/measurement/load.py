"""Reading logs from files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypedDict, Unpack

from wbc.errors import LogError
from wbc.measurement.columns.column_map import ColumnMap, read_column_map
from wbc.measurement.columns.map_choice import patched, restricted
from wbc.measurement.columns.partition import find_parts, read_parts
from wbc.measurement.columns.units import LOG_UNITS
from wbc.measurement.formats.open_table import digest, open_table
from wbc.measurement.formats.table import Table
from wbc.measurement.log import Log
from wbc.measurement.source import LogSource
from wbc.measurement.suspicions.find import require_plausible_units

MAX_ROWS = 2_000_000
"""Longest log kept row by row (2e6 rows of 20 channels take 340 MB); a longer one is decimated."""


class Choices(TypedDict, total=False):
    """What of files is read, and how; the meaning stands at `load_logs`."""

    gear_ratios: Mapping[str, float] | None
    only: Sequence[str] | None
    max_rows: int


def load_log(
    path: str | Path,
    columns: str | Path | ColumnMap | None = None,
    **choices: Unpack[Choices],
) -> Log:
    """Read the one log of a file; the arguments are those of `load_logs`.

    Raises:
        LogError: also when the file holds several logs; the message lists them.
    """
    logs = load_logs([path], columns, **choices)
    if len(logs) != 1:
        parts = ", ".join(log.source.part for log in logs)
        raise LogError(
            f"'{path}' holds {len(logs)} logs; choose one as '{path}#NAME', or read them all with "
            f"load_logs. There are: {parts}."
        )
    return logs[0]


def load_logs(
    paths: Iterable[str | Path],
    columns: str | Path | ColumnMap | None = None,
    **choices: Unpack[Choices],
) -> tuple[Log, ...]:
    """Read logs from CSV, Parquet, NPZ, MCAP and rosbag2 files.

    Args:
        paths: files. `FILE#PATTERN` picks logs by name (`*` and `?` allowed) from a file that a
            column map splits into several.
        columns: column map for foreign names and units, or its path; None for a file that has our
            names (`effort` is read as motor_torque).
        choices: `gear_ratios`: N of joints, for a map that names a side of the gear but no ratio.
            `only`: channels wanted; the others are not read. `max_rows` (default `MAX_ROWS`): a
            longer log is low-passed and decimated by the integer factor that brings it below;
            `log.source.decimation` and the ingest check say so.

    Returns:
        The logs in order of files, and of first appearance within a file.

    Raises:
        LogError: a file, map or log that cannot be used; the message says which and why.
    """
    logs = read_logs(paths, columns, **choices)
    for log in logs:
        require_plausible_units(log)
    return logs


def read_logs(
    paths: Iterable[str | Path],
    columns: str | Path | ColumnMap | None = None,
    *,
    gear_ratios: Mapping[str, float] | None = None,
    only: Sequence[str] | None = None,
    max_rows: int = MAX_ROWS,
) -> tuple[Log, ...]:
    """Read logs as `load_logs` does, also those whose columns contradict each other.

    Raises:
        LogError: a file, map or log that cannot be read; the message says which and why.
    """
    if max_rows < 2:
        raise LogError(f"max_rows is {max_rows}; a log needs at least two rows.")
    if isinstance(columns, str | Path):
        columns = read_column_map(columns, gear_ratios)
    logs: list[Log] = []
    for path in paths:
        logs += _load(path, columns or ColumnMap(()), only, max_rows)
    return tuple(logs)


def _load(
    path: str | Path, columns: ColumnMap, only: Sequence[str] | None, max_rows: int
) -> list[Log]:
    file, pattern = _split_path(path)
    table = open_table(file, columns.rows.topic, columns.rows.header)
    rules, ignored, notes = patched(columns, table)
    rules = _in_units_of_file(restricted(rules, only, str(file)), table)
    source = LogSource(
        str(file),
        digest(file),
        mapping=rules.path,
        ignored=ignored,
        notes=(*table.notes, *notes),
        trusted=rules.trusted,
    )
    parts = find_parts(table, rules, pattern)
    factors = {part: -(-count // max_rows) for part, count in parts.counts.items()}
    sources = {part: replace(source, part=part) for part in parts.counts}
    return read_parts(table, rules, parts, factors, sources)


def _in_units_of_file(rules: ColumnMap, table: Table) -> ColumnMap:
    """Return the map with the unit of the clock that the file itself states."""
    kind, factor = LOG_UNITS.get(table.units.get(rules.time.source, ""), ("", 1.0))
    if kind != "s" or rules.time.factor != 1.0:
        return rules
    return replace(rules, time=replace(rules.time, factor=factor))


def _split_path(path: str | Path) -> tuple[Path, str]:
    """Return (file, pattern of log names) of `FILE#PATTERN`."""
    file, mark, pattern = str(path).rpartition("#")
    if not mark or Path(path).exists():
        return Path(path), ""
    return Path(file), pattern
