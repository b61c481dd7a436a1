"""The search for few terms against trying all of them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from wbc.effects import TorqueTerm
from wbc.identification.formulas.formula import find_formula
from wbc.identification.formulas.sparse_regression import (
    SparseRegression,
    block_errors,
    cell_losses,
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


def test_losses_are_those_of_least_squares() -> None:
    given = table(5, {2: 0.7}, alike=0.5)
    support = SparseRegression(given, np.ones(CELLS, dtype=bool)).fitted((2, 9))
    direct = np.linalg.solve(
        given.gram.sum(axis=0)[np.ix_([2, 9], [2, 9])], given.moment.sum(axis=0)[[2, 9]]
    )
    np.testing.assert_allclose(support.coefficients, direct, rtol=1e-5)
    cells = cell_losses(given, support, np.ones(CELLS, dtype=bool))
    assert cells.sum() == pytest.approx(support.loss, rel=1e-6)
    assert block_errors(given, cells).shape == (CELLS,)


def test_friction_that_would_drive_is_passed_over() -> None:
    given = table(6, {3: -2.0, 8: 0.5}, alike=0.0, dry=True)
    path = SparseRegression(given, np.ones(CELLS, dtype=bool)).path(1)
    assert path[1].chosen == (8,)
    free = table(6, {3: -2.0, 8: 0.5}, alike=0.0)
    assert SparseRegression(free, np.ones(CELLS, dtype=bool)).path(1)[1].chosen == (3,)


def test_the_number_of_terms_is_that_of_the_truth() -> None:
    for seed in range(6):
        formula = find_formula(table(seed, {1: 1.2, 4: -0.8}, alike=1.0))
        assert formula is not None
        assert {term.text for term in formula.terms} == {"sin(2 q_a)", "sin(5 q_a)"}
        assert formula.stability == (1.0, 1.0)
        assert 0.97 < formula.share <= 1.0


def test_noise_alone_has_no_formula() -> None:
    assert all(find_formula(table(seed, {}, alike=1.0)) is None for seed in range(8))
