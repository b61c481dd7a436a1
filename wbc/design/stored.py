"""The table of a study, computed in chunks, and the best compromises among its designs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.design.study import Study, describe_columns
from wbc.errors import DesignError, unknown_name
from wbc.progress import Watch
from wbc.results import Column, ResultTable, fill_table, read_results, results_in_pieces, rows_of

_BLOCK = 1024
_CHUNK = 16384  # designs: about 0.3 s of work, 3 MB of results

Chunk = tuple[int, int]
"""First design, and the one after the last."""


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
    if column not in columns:
        raise DesignError(unknown_name("objective", column, columns))
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
    front = np.zeros((0, costs.shape[1]))
    kept: list[IntArray] = []
    for start in range(0, len(order), _BLOCK):
        rows = order[start : start + _BLOCK]
        rows = rows[~_beaten(costs[rows], front)]
        rows = rows[~_beaten(costs[rows], costs[rows])]
        kept.append(rows)
        front = np.concatenate([front, costs[rows]])
    return np.concatenate(kept) if kept else np.zeros(0, dtype=np.int_)


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


def over_gait(
    table: Mapping[str, FloatArray], instants: int, objectives: Sequence[Objective]
) -> dict[str, FloatArray]:
    """Return one row per design of a table with one row per design and instant.

    An objective is that of the worst instant, NaN where an instant has none; every other column is
    the mean.

    Args:
        table: columns (k instants,), the instants of a design in a row.
        instants: of the gait.
        objectives: what designs are judged by.
    """
    worst = {objective.column: np.min if objective.more else np.max for objective in objectives}
    rows = {name: np.reshape(values, (-1, instants)) for name, values in table.items()}
    return {name: worst.get(name, np.mean)(values, axis=1) for name, values in rows.items()}


def run_study(
    study: Study,
    path: str | Path,
    *,
    workers: int = 1,
    cluster: str | None = None,
    chunk: int = _CHUNK,
    watch: Watch | None = None,
) -> Path:
    """Evaluate every design of a study and write the table; resumes what a killed run left.

    The table is the same to the last bit for any number of workers, on a cluster, and after any
    number of interruptions: chunks have fixed ends and are joined in order.

    Args:
        study: what to evaluate.
        path: the Parquet file.
        workers: processes on this computer; 1 works in this process, -1 takes all cores.
        cluster: address of a Dask scheduler instead, for example "tcp://10.0.0.1:8786".
        chunk: designs per part; part of what must be equal to resume.
        watch: called with the designs done and their total, now and after every part.

    Raises:
        ResultsError: the file belongs to another study.
        ParallelError: workers is 0, or no cluster at the address.
        DynamicsError, TransmissionError: a value outside its range.
    """
    if chunk < 1:
        raise DesignError(f"chunk must be at least 1, got {chunk}.")
    study.designs(0, 1)  # wrong values show before anything is written
    chunks = [(start, min(start + chunk, study.size)) for start in range(0, study.size, chunk)]
    columns = {
        name: Column(unit, "count" if name == "design" else "number")
        for name, unit in describe_columns(study).items()
    }
    table = ResultTable(Path(path), {**study.key(), "chunk": chunk}, columns, len(chunks))
    work = partial(evaluate_chunk, study)
    sizes = [stop - start for start, stop in chunks]
    return fill_table(
        table, work, chunks, workers=workers, cluster=cluster, watch=watch, sizes=sizes
    )


def evaluate_chunk(study: Study, chunk: Chunk) -> dict[str, FloatArray]:
    """Return the part of the table of one chunk; what a worker runs."""
    return study.evaluate(*chunk)


_PIECE = 65536  # rows that are read at a time: 11 MB of 21 columns


def read_designs(path: str | Path) -> dict[str, FloatArray]:
    """Return the columns of a study's table.

    Raises:
        ResultsError: no such file, or not a table of results.
    """
    return {name: np.asarray(x, dtype=np.float64) for name, x in read_results(path).items()}


def best_designs(
    path: str | Path, objectives: Sequence[Objective], instants: int = 0
) -> dict[str, FloatArray]:
    """Return the columns of the Pareto front of a study's table, best in the first objective first.

    The table is read in pieces, so that memory grows with the front and not with the study.

    Args:
        path: the Parquet file.
        objectives: what designs are judged by; see `pareto_front`.
        instants: of the gait, whose worst one counts (`over_gait`); 0 without a gait.

    Raises:
        ResultsError: no such file, or not a table of results.
        DesignError: no objective.
    """
    best: dict[str, FloatArray] = {}
    for piece in _whole_designs(path, max(instants, 1)):
        rows = over_gait(piece, instants, objectives) if instants else piece
        both = _joined(best, rows)
        front = pareto_front(both, objectives)
        best = {name: values[front] for name, values in both.items()}
    return best


def sampled_designs(
    path: str | Path, count: int, objectives: Sequence[Objective], instants: int = 0
) -> dict[str, FloatArray]:
    """Return at most `count` designs of a study's table, evenly spread; all if there are no more.

    Args:
        path: the Parquet file.
        count: how many designs fit into a picture.
        objectives: whose worst instant counts where there is a gait.
        instants: of the gait; 0 without one.

    Raises:
        ResultsError: no such file, or not a table of results.
    """
    width = max(instants, 1)
    every = max(-(-rows_of(path) // (width * count)), 1)
    kept: dict[str, FloatArray] = {}
    for piece in _whole_designs(path, width):
        chosen = piece["design"] // width % every == 0
        rows = {name: values[chosen] for name, values in piece.items()}
        kept = _joined(kept, over_gait(rows, instants, objectives) if instants else rows)
    return kept


def _whole_designs(path: str | Path, instants: int) -> Iterator[dict[str, FloatArray]]:
    """Yield the rows of a table in pieces that cut through no design's instants."""
    left: dict[str, FloatArray] = {}
    for read in results_in_pieces(path, _PIECE):
        piece = _joined(left, {name: np.asarray(x, dtype=np.float64) for name, x in read.items()})
        whole = len(piece["design"]) // instants * instants
        yield {name: values[:whole] for name, values in piece.items()}
        left = {name: values[whole:] for name, values in piece.items()}


def _joined(first: dict[str, FloatArray], second: dict[str, FloatArray]) -> dict[str, FloatArray]:
    if not first:
        return second
    return {name: np.concatenate([first[name], values]) for name, values in second.items()}
