"""Dealing the rows of one file out to the logs that it holds."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase

import numpy as np

from wbc.arrays import IntArray
from wbc.errors import LogError
from wbc.measurement.columns.column_map import ColumnMap
from wbc.measurement.columns.intake import Intake
from wbc.measurement.formats.table import Chunk, Table
from wbc.measurement.log import Log
from wbc.measurement.source import LogSource


def count_rows(table: Table, rules: ColumnMap, pattern: str) -> dict[str, int]:
    """Return the rows of every log that is wanted, by its name ('' where the file is one log).

    Args:
        table: the file.
        rules: says which column splits the file and which rows count.
        pattern: shell pattern of the names wanted, empty for all.

    Raises:
        LogError: nothing fits; the message lists the logs that there are.
    """
    if not rules.rows.keys:
        if pattern:
            raise LogError(
                f"{table.path}: '#{pattern}' picks one of several logs, but nothing splits the "
                'file; name the column in a map: [rows] split = "...".'
            )
        if not table.rows:
            raise LogError(f"'{table.path}' is empty: it has columns but no rows.")
        return {"": table.rows}
    counts: dict[str, int] = {}
    for chunk in table.chunks([], rules.rows.keys):
        for part, rows in _parts(chunk, rules).items():
            counts[part] = counts.get(part, 0) + rows.size
    wanted = {p: n for p, n in counts.items() if not pattern or fnmatchcase(p, pattern)}
    if not wanted:
        where = ", ".join(f"{column} = {value}" for column, value in rules.rows.where.items())
        raise LogError(
            f"{table.path}: no log '{pattern or '*'}'{' where ' + where if where else ''}. "
            f"There are: {', '.join(counts) or '(none)'}."
        )
    return wanted


def read_parts(
    table: Table,
    rules: ColumnMap,
    factors: Mapping[str, int],
    sources: Mapping[str, LogSource],
) -> list[Log]:
    """Return the logs of a file, in order of first appearance, in one pass over its rows.

    Args:
        table: the file; it has all columns that `rules` needs.
        rules: how channels and rows are chosen.
        factors: of decimation, by name of the log; logs without one are passed over.
        sources: provenance, by name of the log.

    Raises:
        LogError: rows that are no log.
    """
    numbers = dict.fromkeys(name for rule in rules.rules for name in rule.sources)
    if rules.time.source:
        numbers[rules.time.source] = None
    intakes = {part: Intake(rules, factors[part], sources[part]) for part in factors}
    for chunk in table.chunks(list(numbers), rules.rows.keys):
        for part, rows in _parts(chunk, rules).items():
            if part in intakes:
                intakes[part].push({name: chunk[name][rows] for name in numbers}, rows.size)
    return [intake.finish() for intake in intakes.values()]


def _parts(chunk: Chunk, rules: ColumnMap) -> dict[str, IntArray]:
    """Return the rows of a chunk by the log they belong to, in order of first appearance."""
    size = len(next(iter(chunk.values())))
    rows = np.arange(size)
    if rules.rows.where:
        rows = rows[rules.rows.keeps(chunk, size)]
    if not rules.rows.split or not rows.size:
        return {"": rows} if rows.size else {}
    names, first, inverse = np.unique(
        chunk[rules.rows.split][rows], return_index=True, return_inverse=True
    )
    return {str(names[k]): rows[inverse == k] for k in np.argsort(first)}
