"""Reading logs from files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from wbc.errors import LogError
from wbc.measurement.checks.unit_check import require_plausible_units
from wbc.measurement.columns.column_map import ColumnMap, read_column_map
from wbc.measurement.columns.map_choice import for_table, native_map, restricted
from wbc.measurement.columns.partition import count_rows, read_parts
from wbc.measurement.formats.open_table import digest, open_table
from wbc.measurement.log import Log
from wbc.measurement.source import LogSource

MAX_ROWS = 2_000_000
"""Longest log kept row by row (2e6 rows of 20 channels take 340 MB); a longer one is decimated."""


def load_log(
    path: str | Path,
    columns: str | Path | ColumnMap | None = None,
    *,
    gear_ratios: Mapping[str, float] | None = None,
    only: Sequence[str] | None = None,
    max_rows: int = MAX_ROWS,
) -> Log:
    """Read the one log of a file; the arguments are those of `load_logs`.

    Raises:
        LogError: also when the file holds several logs; the message lists them.
    """
    logs = load_logs([path], columns, gear_ratios=gear_ratios, only=only, max_rows=max_rows)
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
    *,
    gear_ratios: Mapping[str, float] | None = None,
    only: Sequence[str] | None = None,
    max_rows: int = MAX_ROWS,
) -> tuple[Log, ...]:
    """Read logs from CSV, Parquet, NPZ, MCAP and rosbag2 files.

    Args:
        paths: files. `FILE#PATTERN` picks logs by name (`*` and `?` allowed) from a file that a
            column map splits into several.
        columns: column map for foreign names and units, or its path; None for a file that has our
            names (a bag counts as such: JointState effort is read as motor_torque).
        gear_ratios: N of joints, for a map that names a side of the gear but no ratio.
        only: channels wanted; the others are not read.
        max_rows: a longer log is low-passed and decimated by the integer factor that brings it
            below; `log.source.decimation` and the ingest check say so.

    Returns:
        The logs in order of files, and of first appearance within a file.

    Raises:
        LogError: a file, map or log that cannot be used; the message says which and why.
    """
    if max_rows < 2:
        raise LogError(f"max_rows is {max_rows}; a log needs at least two rows.")
    if isinstance(columns, str | Path):
        columns = read_column_map(columns, gear_ratios)
    logs: list[Log] = []
    for path in paths:
        logs += _load(path, columns, only, max_rows)
    for log in logs:
        require_plausible_units(log)
    return tuple(logs)


def _load(
    path: str | Path, columns: ColumnMap | None, only: Sequence[str] | None, max_rows: int
) -> list[Log]:
    file, pattern = _split_path(path)
    table = open_table(file, columns.rows.topic if columns else "")
    rules, ignored = (columns, ()) if columns else native_map(table)
    rules = for_table(restricted(rules, only, str(file)), table)
    source = LogSource(str(file), digest(file), mapping=rules.path, ignored=ignored)
    counts = count_rows(table, rules, pattern)
    factors = {part: -(-count // max_rows) for part, count in counts.items()}
    sources = {part: replace(source, part=part) for part in counts}
    return read_parts(table, rules, factors, sources)


def _split_path(path: str | Path) -> tuple[Path, str]:
    """Return (file, pattern of log names) of `FILE#PATTERN`."""
    file, mark, pattern = str(path).rpartition("#")
    if not mark or Path(path).exists():
        return Path(path), ""
    return Path(file), pattern
