from __future__ import annotations

import numpy as np
import pytest

from wbc.design import Objective, pareto_front, parse_objective
from wbc.errors import DesignError


def brute(costs: np.ndarray) -> set[int]:
    """Return the rows that no other row beats, by comparing all pairs."""
    found = set()
    for i, row in enumerate(costs):
        beaten = any(np.all(o <= row) and np.any(o < row) for o in costs)
        if np.isfinite(row).all() and not beaten:
            found.add(i)
    return found


@pytest.mark.parametrize("columns", [1, 2, 3])
@pytest.mark.parametrize("rounded", [False, True])
def test_the_front_is_that_of_all_pairs(columns: int, rounded: bool) -> None:
    random = np.random.default_rng(columns).normal(size=(400, columns))
    values = np.round(random, 1) if rounded else random  # rounded: equal rows and ties
    table = {f"c{i}": values[:, i] for i in range(columns)}
    signs = np.array([1.0, -1.0, 1.0])[:columns]
    objectives = [Objective(f"c{i}", signs[i] < 0) for i in range(columns)]
    front = pareto_front(table, objectives)
    assert set(front.tolist()) == brute(values * signs)
    assert np.all(np.diff((values * signs)[front, 0]) >= 0.0)


def test_more_rows_than_a_block() -> None:
    values = np.random.default_rng(0).normal(size=(5000, 2))
    values[::7] = 0.1 * values[::7] + 2.0
    front = pareto_front({"a": values[:, 0], "b": values[:, 1]}, [Objective("a"), Objective("b")])
    assert set(front.tolist()) == brute(-values)


def test_rows_without_a_number_never_count() -> None:
    table = {"a": np.array([1.0, np.nan, 3.0, np.inf]), "b": np.array([2.0, 9.0, np.nan, 0.0])}
    assert pareto_front(table, [Objective("a"), Objective("b")]).tolist() == [3, 0]
    nothing = {"a": np.array([np.nan])}
    assert pareto_front(nothing, [Objective("a")]).size == 0


def test_objectives_are_read_and_checked() -> None:
    assert parse_objective("a:min", ["a"]) == Objective("a", more=False)
    for text in ("b:max", "a", "a:best"):
        with pytest.raises(DesignError):
            parse_objective(text, ["a"])
    with pytest.raises(DesignError, match="at least one"):
        pareto_front({"a": np.ones(1)}, [])
