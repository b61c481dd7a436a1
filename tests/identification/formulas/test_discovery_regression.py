"""The search for few terms against trying all of them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from wbc.effects import TorqueTerm
from wbc.identification.formulas.sparse_regression import (
    SparseRegression,
)
from wbc.identification.formulas.term_table import TermTable

ROWS, CELLS, COUNT = 1200, 24, 14


def table(seed: int, truth: dict[int, float], alike: float, dry: bool = False) -> TermTable:
    """Return a table whose columns share a common part, with unit noise in the residual."""
    random = np.random.default_rng(seed)
    columns = random.normal(size=(ROWS, COUNT)) + alike * random.normal(size=(ROWS, 1))
    residual = random.normal(size=ROWS)
    for k, value in truth.items():
        residual += value * columns[:, k]
    names = [f"sin({k + 1} q_a)" for k in range(COUNT)]
    a, r = columns.reshape(CELLS, -1, COUNT), residual.reshape(CELLS, -1)
    return TermTable(
        joint="a",
        terms=tuple(TorqueTerm.parse(name) for name in names),
        gram=np.einsum("cni,cnj->cij", a, a),
        moment=np.einsum("cni,cn->ci", a, r),
        energy=(r**2).sum(axis=1),
        count=np.full(CELLS, r.shape[1], dtype=float),
        folds=np.arange(CELLS) // 6,
        blocks=np.arange(CELLS),
        levels=np.abs(columns) if dry else np.zeros((ROWS, COUNT)),
    )


@pytest.mark.parametrize("seed", range(4))
def test_the_path_holds_the_best_subsets_of_all(seed: int) -> None:
    random = np.random.default_rng(90 + seed)
    truth = dict(zip(range(4), random.normal(size=4), strict=True))
    given = table(seed, truth, alike=1.5)
    regression = SparseRegression(given, np.ones(CELLS, dtype=bool))
    path = regression.path(3)
    assert [len(support.chosen) for support in path] == [0, 1, 2, 3]
    for support in path[1:]:
        every = combinations(range(COUNT), len(support.chosen))
        lowest = min(regression.fitted(chosen).loss for chosen in every)
        assert support.loss == pytest.approx(lowest, rel=1e-9)
