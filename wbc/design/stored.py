"""The table of a study, computed in chunks, and the best compromises among its designs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.design.study import Study, describe_columns
from wbc.errors import DesignError, needs, require_known
from wbc.files import atomic_write
from wbc.parallel import Watch, run_jobs

_BLOCK = 1024
_CHUNK = 16384  # designs: about 0.3 s of work, 3 MB of results


@dataclass(frozen=True)
class Objective:
    """A column of the table and whether more of it is better."""

    column: str
    more: bool = True

    def cost(self, table: Mapping[str, FloatArray]) -> FloatArray:
        """Return the column as something to make small; infinitely bad where it is NaN."""
        values = np.asarray(table[self.column], dtype=np.float64)
        return np.where(np.isnan(values), np.inf, -values if self.more else values)


def parse_objective(text: str, columns: Sequence[str]) -> Objective:
    """Return the objective of `COLUMN:max` or `COLUMN:min`.

    Raises:
        DesignError: text of another form, or no such column.
    """
    column, _, way = text.strip().partition(":")
    require_known(DesignError, "objective", column, columns)
    if way not in ("max", "min"):
        raise DesignError(f"objective '{text}': use {column}:max or {column}:min.")
    return Objective(column, way == "max")


def pareto_front(table: Mapping[str, FloatArray], objectives: Sequence[Objective]) -> IntArray:
    """Return the rows that no other row beats, best in the first objective first.

    A row is beaten by one that is at least as good in every objective and better in one; of equal
    rows all stay. Rows with a NaN objective never count.

    Raises:
        DesignError: no objective.
    """
    if not objectives:
        raise DesignError("a Pareto front needs at least one objective.")
    costs = np.stack([objective.cost(table) for objective in objectives], axis=1)
    usable = np.flatnonzero((costs < np.inf).all(axis=1))
    # Whoever beats a row comes before it in this order, so that one pass over the front suffices.
    order = usable[np.lexsort(costs[usable].T[::-1])]
    if len(objectives) <= 2:
        return order[~_beaten_in_order(costs[order, 0], costs[order, -1])]
    front = order[:0]
    for start in range(0, len(order), _BLOCK):
        rows = order[start : start + _BLOCK]
        rows = rows[~_beaten(costs[rows], costs[front])]
        rows = rows[~_beaten(costs[rows], costs[rows])]
        front = np.concatenate([front, rows])
    return front


def _beaten_in_order(first: FloatArray, second: FloatArray) -> BoolArray:
    """Return which rows (n,) of two costs some other beats; sorted by the first, then the second.

    A row is beaten by one with a smaller first cost and no larger second one, or with the same
    first cost and a smaller second one: one pass instead of all pairs.
    """
    begins = np.searchsorted(first, first)  # first row of those with the same first cost
    least = np.concatenate([[np.inf], np.minimum.accumulate(second)])[begins]
    return np.asarray((least <= second) | (second[begins] < second))


def _beaten(costs: FloatArray, by: FloatArray) -> BoolArray:
    """Return which rows of `costs` (a, n) some row of `by` (b, n) beats, (a,) bool."""
    found = np.zeros(len(costs), dtype=np.bool_)
    for start in range(0, len(by), _BLOCK):
        some = by[start : start + _BLOCK]
        no_worse = np.all(some[None] <= costs[:, None], axis=2)
        better = np.any(some[None] < costs[:, None], axis=2)
        found |= np.any(no_worse & better, axis=1)
    return found


def run_study(
    study: Study,
    path: str | Path,
    *,
    workers: int = 1,
    chunk: int = _CHUNK,
    watch: Watch = lambda done, total: None,
) -> Path:
    """Evaluate every design of a study and write the table, whole or not at all.

    The table is the same to the last bit for any number of workers.

    Args:
        study: what to evaluate.
        path: the Parquet file; its columns hold their units.
        workers: processes on this computer; 1 works in this process, -1 takes all cores.
        chunk: designs that are evaluated at once.
        watch: called with the designs done and their total, now and after every chunk.

    Raises:
        ParallelError: workers is 0.
        DynamicsError, TransmissionError: a value outside its range.
    """
    study.designs(0, 1)  # wrong values show before anything is written
    pa, pq = _pyarrow()
    chunks = [range(study.size)[start : start + chunk] for start in range(0, study.size, chunk)]
    schema = pa.schema(
        pa.field(name, pa.float64(), metadata={"unit": unit})
        for name, unit in describe_columns(study).items()
    )

    def write(file: BinaryIO) -> None:
        results = run_jobs(study.evaluate, chunks, workers)
        with pq.ParquetWriter(file, schema) as writer:
            for rows, columns in zip(chunks, results, strict=True):
                writer.write_table(pa.table(columns, schema=schema))
                watch(rows.stop, study.size)

    watch(0, study.size)
    return atomic_write(path, write)


def best_designs(path: str | Path, objectives: Sequence[Objective]) -> dict[str, FloatArray]:
    """Return the columns of the Pareto front of a study's table, best in the first objective first.

    The table is read in pieces, so that memory grows with the front and not with the study.

    Args:
        path: the Parquet file.
        objectives: what designs are judged by; see `pareto_front`.

    Raises:
        OSError: no such file.
        DesignError: no objective.
    """
    best: dict[str, FloatArray] = {}
    for piece in _pieces(path):
        both = {n: np.concatenate([best.get(n, x[:0]), x]) for n, x in piece.items()}
        front = pareto_front(both, objectives)
        best = {name: values[front] for name, values in both.items()}
    return best


def sampled_designs(path: str | Path, count: int) -> dict[str, FloatArray]:
    """Return at most `count` designs of a study's table, evenly spread; all if there are no more.

    Args:
        path: the Parquet file.
        count: how many designs fit into a picture.

    Raises:
        OSError: no such file.
    """
    _, pq = _pyarrow()
    kept, every = dict[str, FloatArray](), max(-(-pq.read_metadata(path).num_rows // count), 1)
    for piece in _pieces(path):
        chosen = piece["design"] % every == 0
        kept = {n: np.concatenate([kept.get(n, x[:0]), x[chosen]]) for n, x in piece.items()}
    return kept


def _pieces(path: str | Path) -> Iterator[dict[str, FloatArray]]:
    """Yield the row groups of a table."""
    _, pq = _pyarrow()
    with pq.ParquetFile(path) as file:
        for number in range(file.metadata.num_row_groups):
            group = file.read_row_group(number)
            yield {name: group[name].to_numpy() for name in group.column_names}


def _pyarrow() -> tuple[Any, Any]:
    """Return pyarrow and its module for Parquet; only tables of designs need them."""
    with needs("design", "a table of designs"):
        import pyarrow as pa
        import pyarrow.parquet as pq
    return pa, pq
