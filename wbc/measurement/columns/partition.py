"""Dealing the rows of one file out to the logs that it holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import chain

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.errors import LogError
from wbc.measurement.columns.column_map import ColumnMap
from wbc.measurement.columns.intake import Intake
from wbc.measurement.columns.mend import say_so
from wbc.measurement.formats.table import Chunk, Table
from wbc.measurement.gaps import GAP_STEPS
from wbc.measurement.log import Log
from wbc.measurement.source import LogSource

_SHOWN = 8  # combinations of values that a message lists


@dataclass(frozen=True)
class Parts:
    """The logs of one file.

    Attributes:
        counts: rows of every log that is wanted, by its name ('' where the file is one log).
        starts: value of the splitting column -> rows of the file from which its logs begin.
    """

    counts: Mapping[str, int]
    starts: Mapping[str, IntArray]

    def name(self, value: str, segment: int) -> str:
        """Return the name of one log of a value: the value, numbered where there are several."""
        return value if len(self.starts[value]) == 1 else f"{value}/{segment + 1}"


def find_parts(table: Table, rules: ColumnMap, pattern: str) -> Parts:
    """Return the logs that a file holds.

    A log is what a value of the splitting column marks without a break: where the value comes back
    after a gap of the clock, or the clock starts again, another log begins. Logs whose rows
    alternate on one clock are no break.

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
                f"file. {_splitting(table, pattern)}"
            )
        if not table.rows:
            raise LogError(f"'{table.path}' is empty: it has columns but no rows.")
        return Parts({"": table.rows}, {"": np.zeros(1, dtype=np.int_)})
    places: dict[str, list[IntArray]] = {}
    times: dict[str, list[FloatArray]] = {}
    clock = [rules.time.source] if rules.time.source else []
    for first, chunk in _numbered(table.chunks(clock, rules.rows.keys)):
        for value, rows in _by_value(chunk, rules).items():
            places.setdefault(value, []).append(first + rows)
            stamps = chunk[clock[0]][rows] if clock else (first + rows).astype(np.float64)
            times.setdefault(value, []).append(stamps)
    starts: dict[str, IntArray] = {}
    found: list[tuple[int, str, int]] = []
    for value, pieces in places.items():
        rows = np.concatenate(pieces)
        breaks = np.concatenate([[0], _breaks(rows, np.concatenate(times[value])), [rows.size]])
        starts[value] = rows[breaks[:-1]]
        for k, size in enumerate(np.diff(breaks)):
            part = value if breaks.size == 2 else f"{value}/{k + 1}"
            found.append((int(starts[value][k]), part, int(size)))
    counts = {part: size for _, part, size in sorted(found)}
    wanted = {p: n for p, n in counts.items() if not pattern or fnmatchcase(p, pattern)}
    if not wanted:
        where = ", ".join(f"{column} = {value}" for column, value in rules.rows.where.items())
        there = f"There are: {', '.join(counts)}." if counts else _present(table, rules)
        raise LogError(
            f"{table.path}: no log '{pattern or '*'}'{' where ' + where if where else ''}. {there}"
        )
    return Parts(wanted, starts)


def _present(table: Table, rules: ColumnMap) -> str:
    """Return which values the columns hold of which a map wants others, for a file with no row."""
    columns = list(rules.rows.where)
    chunks = table.chunks([], rules.rows.keys)
    rows = (zip(*(chunk[c].tolist() for c in columns), strict=True) for chunk in chunks)
    found = list(dict.fromkeys(chain.from_iterable(rows)))
    shown = [", ".join(f"{c} = {v}" for c, v in zip(columns, row, strict=True)) for row in found]
    more = [f"and {len(shown) - _SHOWN} more"] if len(shown) > _SHOWN else []
    return f"The file holds: {'; '.join([*shown[:_SHOWN], *more]) or 'no rows'}."


def _splitting(table: Table, pattern: str) -> str:
    """Return how to split a file: by the column that holds what a pattern names."""
    for name in table.names:
        try:
            values = next(iter(table.chunks([], [name])))[name]
        except (LogError, StopIteration):
            continue
        if any(fnmatchcase(str(value), pattern) for value in np.unique(values)):
            return f"Its column '{name}' has such values; " + say_so({"rows": {"split": name}})
    return f"Leave '#{pattern}' out: no column begins with rows that it names."


def read_parts(
    table: Table,
    rules: ColumnMap,
    parts: Parts,
    factors: Mapping[str, int],
    sources: Mapping[str, LogSource],
) -> list[Log]:
    """Return the logs of a file, in order of first appearance, in one pass over its rows.

    Args:
        table: the file; it has all columns that `rules` needs.
        rules: how channels and rows are chosen.
        parts: from `find_parts`.
        factors: of decimation, by name of the log; logs without one are passed over.
        sources: provenance, by name of the log.

    Raises:
        LogError: rows that are no log.
    """
    numbers = dict.fromkeys(name for rule in rules.rules for name in rule.sources)
    if rules.time.source:
        numbers[rules.time.source] = None
    intakes = {part: Intake(rules, factors[part], sources[part]) for part in factors}
    for first, chunk in _numbered(table.chunks(list(numbers), rules.rows.keys)):
        for value, rows in _by_value(chunk, rules).items():
            segments = np.searchsorted(parts.starts[value], first + rows, side="right") - 1
            for segment in np.unique(segments):
                part, own = parts.name(value, int(segment)), rows[segments == segment]
                if part in intakes:
                    intakes[part].push({name: chunk[name][own] for name in numbers}, own.size)
    return [intake.finish() for intake in intakes.values()]


def _numbered(chunks: Iterator[Chunk]) -> Iterator[tuple[int, Chunk]]:
    """Yield the number of the first row of each piece with it."""
    first = 0
    for chunk in chunks:
        yield first, chunk
        first += len(next(iter(chunk.values())))


def _breaks(rows: IntArray, time: FloatArray) -> IntArray:
    """Return the places at which a value that other rows interrupted begins a new log."""
    interrupted = np.diff(rows) > 1
    if not interrupted.any():
        return np.zeros(0, dtype=np.int_)
    steps = np.diff(time)
    usual = float(np.nanmedian(steps))
    return np.flatnonzero(interrupted & ~((steps > 0.0) & (steps <= GAP_STEPS * usual))) + 1


def _by_value(chunk: Chunk, rules: ColumnMap) -> dict[str, IntArray]:
    """Return the rows of a chunk by the value that splits the file, in order of appearance."""
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
