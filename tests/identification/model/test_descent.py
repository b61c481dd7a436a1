"""Steps downhill against a solver of convex problems, and at the ends of ranges."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

from wbc.effects import CoulombFriction, LinkInertia
from wbc.effects.pseudo_inertia import LOG_CHOLESKY, USUAL, divergence, numbers_of
from wbc.identification.model.descent import Linearised, bounded, ranges
from wbc.identification.model.usual import Drawings, UsualRows, cost
from wbc.robot import Effect

SAMPLES = np.ones(2)


def _effects(numbers: np.ndarray) -> tuple[Effect, ...]:
    values = dict(zip(LOG_CHOLESKY, numbers.tolist(), strict=True))
    return CoulombFriction("knee", 0.1), LinkInertia.at("shank", values)


def _linear(random: np.random.Generator, effects: tuple[Effect, ...]) -> SimpleNamespace:
    """Return what a fit leaves that is linear in a level and in the pseudo-inertia of a link."""
    slots = tuple((k, p) for k, effect in enumerate(effects) for p in effect.parameters)
    jacobian = random.normal(size=(40, 2, len(slots)))
    residual = 4.0 * random.normal(size=(40, 2))
    usual = UsualRows.of(effects, slots, residual, SAMPLES)
    here = Linearised.of(effects, slots, residual, jacobian, usual)
    return SimpleNamespace(slots=slots, jacobian=jacobian, residual=residual, usual=usual, at=here)


@pytest.mark.parametrize("seed", range(3))
def test_a_step_ends_where_a_general_solver_does(seed: int) -> None:
    random = np.random.default_rng(seed)
    start = random.normal(scale=0.5, size=10)
    effects = _effects(start)
    given, drawings = _linear(random, effects), Drawings.of(effects)
    scales = np.array([p.scale for _, p in given.slots])
    weights = given.usual.weights

    def whole(step: np.ndarray) -> float:
        left = (given.residual + given.jacobian @ step) * weights
        return float(np.sum(left**2) + drawings.cost(drawings.along((step * scales)[None, 1:])))

    step = given.at.step(0.0, 1e-6)
    room = ranges(effects, given.slots)[:, :1].T.tolist() + 10 * [(None, None)]
    options = {"maxiter": 4000}
    best = minimize(whole, step.along, method="Nelder-Mead", bounds=room, options=options)
    assert step.promised == pytest.approx(whole(np.zeros(11)) - whole(step.along))
    assert whole(step.along) < best.fun + 1e-3
    # Its effects are the body of that pseudo-inertia.
    (found,) = Drawings.of(step.effects).matrices
    np.testing.assert_allclose(found, drawings.along((step.along * scales)[None, 1:])[0])


def test_a_share_of_a_step_is_on_the_way_to_its_end() -> None:
    random = np.random.default_rng(3)
    given = _linear(random, _effects(random.normal(scale=0.3, size=10)))
    whole, half = given.at.step(0.0, 1e-6), given.at.step(0.0, 1e-6, 0.5)
    np.testing.assert_allclose(half.along, 0.5 * whole.along)
    assert 0.0 < half.promised < whole.promised


def test_damping_shortens_a_step() -> None:
    random = np.random.default_rng(5)
    given = _linear(random, _effects(np.zeros(10)))
    sizes = [np.linalg.norm(given.at.step(damping, 1e-6).along) for damping in (0.0, 0.1, 10.0)]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[2] < 0.5 * sizes[0]


@pytest.mark.parametrize("seed", range(5))
def test_numbers_that_would_leave_their_range_end_at_it(seed: int) -> None:
    random = np.random.default_rng(seed)
    a, b = random.normal(size=(30, 4)), random.normal(size=30)
    room = np.array([[-0.02, -9.0, -9.0, -9.0], [9.0, 9.0, 9.0, 0.03]])
    step, free = bounded(a.T @ a, a.T @ b, room)
    wanted = lsq_linear(a, -b, room)
    np.testing.assert_allclose(step, wanted.x, atol=1e-6)
    np.testing.assert_array_equal(free, wanted.active_mask == 0)


def test_what_a_fit_makes_least_counts_links_by_their_divergence() -> None:
    numbers = np.full(10, 0.05)  # no more wrong than drawings usually are
    effects, left = _effects(numbers), np.zeros((7, 2))
    drawn = cost(effects, left, SAMPLES) - cost(_effects(np.zeros(10)), left, SAMPLES)
    (matrix,) = Drawings.of(effects).matrices
    assert drawn == pytest.approx(divergence(matrix) / USUAL**2)
    np.testing.assert_allclose(numbers_of(matrix), numbers)
    assert cost(effects[:1], left + 2.0, SAMPLES) == 4.0 * left.size


def test_the_rows_of_what_is_usual_are_derivatives() -> None:
    random = np.random.default_rng(7)
    effects = _effects(random.normal(scale=0.05, size=10))
    slots = tuple((1, p) for p in effects[1].parameters)
    left = random.normal(size=(7, 2))
    rows = UsualRows.of(effects, slots, left, SAMPLES)
    for column, (_, p) in enumerate(slots):
        value, step = effects[1].values[p.name], 1e-6
        more = effects[1].with_values({p.name: value + step * p.scale})
        there = UsualRows.of((effects[0], more), slots, left, SAMPLES)
        slope = (there.residual - rows.residual) / step
        np.testing.assert_allclose(rows.jacobian[:, column], slope, rtol=1e-3, atol=1e-3)
    assert replace(rows, noise=4.0 * SAMPLES).weights == pytest.approx(0.5)
