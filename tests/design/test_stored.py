"""The front of a table that is read in pieces is that of the whole table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wbc.design.stored as stored
from wbc.design import (
    Objective,
    best_designs,
    over_gait,
    pareto_front,
    read_designs,
    sampled_designs,
)
from wbc.results import Column, ResultTable

OBJECTIVES = [Objective("lift"), Objective("inertia", more=False)]
ROWS, INSTANTS = 3000, 3


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rows with a front of many designs, ties and places without a number, in three parts."""
    random = np.random.default_rng(4)
    lift = random.normal(size=ROWS).round(2)
    columns = {
        "design": np.arange(ROWS),
        "lift": np.where(random.random(ROWS) < 0.05, np.nan, lift),
        "inertia": (lift + 0.1 * random.normal(size=ROWS)).round(2),
    }
    kinds = {name: Column("1", "count" if name == "design" else "number") for name in columns}
    results = ResultTable(
        tmp_path_factory.mktemp("designs") / "designs.parquet", {}, kinds, parts=3
    )
    results.begin()
    for part, rows in enumerate(np.split(np.arange(ROWS), [1100, 2500])):
        results.add(part, {name: values[rows] for name, values in columns.items()})
    return results.finish()


@pytest.mark.parametrize("piece", [7, 100, 10_000])
@pytest.mark.parametrize("instants", [0, INSTANTS])
def test_the_front_of_pieces_is_the_front_of_the_whole(
    table: Path, piece: int, instants: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored, "_PIECE", piece)
    whole = read_designs(table)
    rows = over_gait(whole, instants, OBJECTIVES) if instants else whole
    front = pareto_front(rows, OBJECTIVES)
    assert len(front) > 10
    best = best_designs(table, OBJECTIVES, instants)
    assert list(best) == list(rows)
    for name, values in rows.items():
        np.testing.assert_array_equal(best[name], values[front])


def test_a_picture_gets_whole_designs_evenly_spread(table: Path) -> None:
    assert len(sampled_designs(table, ROWS, OBJECTIVES)["design"]) == ROWS
    few = sampled_designs(table, 100, OBJECTIVES)
    assert few["design"].tolist() == list(range(0, ROWS, 30))
    gait = sampled_designs(table, 100, OBJECTIVES, INSTANTS)
    whole = over_gait(read_designs(table), INSTANTS, OBJECTIVES)
    np.testing.assert_array_equal(gait["lift"], whole["lift"][::10])
