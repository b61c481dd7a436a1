"""The best compromises among designs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import DesignError, unknown_name

_BLOCK = 1024


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
