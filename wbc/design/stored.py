"""The table of a study, and the best compromises among its designs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.design.study import Study, describe_columns
from wbc.errors import DesignError, needs, require_known
from wbc.files import atomic_write
from wbc.parallel import Watch

_CHUNK = 4096  # designs at once: their arrays stay in the cache of the processor


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
    front, left = list[int](), np.ascontiguousarray(costs[order].T)
    while order.size:
        front.append(order[0])
        best = left[:, :1]
        kept = (left < best).any(axis=0) | (left == best).all(axis=0)
        kept[0] = False
        order, left = order[kept], left[:, kept]
    return np.array(front, dtype=np.int_)


def _beaten_in_order(first: FloatArray, second: FloatArray) -> BoolArray:
    """Return which rows (n,) of two costs some other beats; sorted by the first, then the second.

    A row is beaten by one with a smaller first cost and no larger second one, or with the same
    first cost and a smaller second one: one pass instead of all pairs.
    """
    begins = np.searchsorted(first, first)  # first row of those with the same first cost
    least = np.concatenate([[np.inf], np.minimum.accumulate(second)])[begins]
    return np.asarray((least <= second) | (second[begins] < second))


def run_study(
    study: Study, path: str | Path, watch: Watch = lambda done, total: None
) -> dict[str, FloatArray]:
    """Evaluate every design of a study, write the table, and return its columns.

    Args:
        study: what to evaluate.
        path: the Parquet file, written whole or not at all; its columns hold their units.
        watch: called with the designs done and their total, now and after every chunk.

    Raises:
        MissingPackageError: pyarrow is not installed.
        DynamicsError, TransmissionError: a value outside its range.
    """
    with needs("design", "a table of designs"):
        import pyarrow as pa
        import pyarrow.parquet as pq
    parts = []
    for start in range(0, study.size, _CHUNK):
        watch(start, study.size)
        parts.append(study.evaluate(range(study.size)[start : start + _CHUNK]))
    watch(study.size, study.size)
    units = describe_columns(study)
    table = {name: np.concatenate([part[name] for part in parts]) for name in units}
    schema = pa.schema(
        pa.field(name, pa.float64(), metadata={"unit": unit}) for name, unit in units.items()
    )
    atomic_write(path, lambda file: pq.write_table(pa.table(table, schema=schema), file))
    return table
