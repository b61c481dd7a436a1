"""The small linear system that a guess at the binding constraints leaves, compiled."""

from __future__ import annotations

from wbc.arrays import FloatArray
from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Matrix,
    Nothing,
    Number,
    OutDense,
    OutVector,
    Vector,
    compiled,
)
from wbc.control.solvers.positive_definite import factorise, substitute

_SOLVES = 2


@compiled(Nothing, Matrix, Vector, Vector, Vector, OutDense, OutVector, OutVector)
def place_tasks(
    jacobian: FloatArray,
    wanted: FloatArray,
    pull: FloatArray,
    inverse: FloatArray,
    G: FloatArray,
    right: FloatArray,
    free: FloatArray,
) -> None:
    """Write task rows (k, nv) = `wanted` (k,) on top of G, and qdd = D^-1 pull (nv,) into free."""
    for i in range(len(wanted)):
        right[i] = wanted[i]
        for j in range(len(pull)):
            G[i, j] = jacobian[i, j]
    for j in range(len(pull)):
        free[j] = inverse[j] * pull[j]


@compiled(
    Flag,
    *(Dense, Vector, Vector, Vector, Vector, Count, Number),
    *(OutVector, OutVector, OutDense, OutDense, OutVector),
)
def meet_rows(
    G: FloatArray,
    right: FloatArray,
    softness: FloatArray,
    inverse: FloatArray,
    free: FloatArray,
    size: int,
    allowed: float,
    x: FloatArray,
    force: FloatArray,
    scaled: FloatArray,
    system: FloatArray,
    left: FloatArray,
) -> bool:
    """Solve (G D^-1 G' + S) force = right - G free for x = free + D^-1 G' force, and check it.

    Args:
        G, right, softness: rows (.., n), (..,) and the diagonal S, of which `size` count.
        inverse: diagonal of D^-1 (n,).
        free: x without any row (n,).
        size: number of rows.
        allowed: greatest sum of squares of what the rows may miss.
        x, force: results (n,), (..,).
        scaled, system, left: memory (.., n), (.., ..), (..,).

    Returns:
        whether the rows are met; they are not where they depend on one another.
    """
    n = len(x)
    for i in range(size):
        missing = right[i]
        for j in range(n):
            scaled[i, j] = G[i, j] * inverse[j]
            missing -= G[i, j] * free[j]
        force[i], left[i] = 0.0, missing
        for k in range(i + 1):
            product = 0.0
            for j in range(n):
                product += scaled[i, j] * G[k, j]
            system[i, k] = product
        system[i, i] += softness[i]
    if not factorise(system, size):
        return False
    for _ in range(_SOLVES):
        substitute(system, size, left)
        x[:] = free
        for i in range(size):
            force[i] += left[i]
            for j in range(n):
                x[j] += scaled[i, j] * force[i]
        total = 0.0
        for i in range(size):
            missing = right[i] - softness[i] * force[i]
            for j in range(n):
                missing -= G[i, j] * x[j]
            left[i] = missing
            total += missing * missing
        if total <= allowed:
            return True
    return False


@compiled(Number, Dense, Vector, Vector, OutVector)
def excess(rows: FloatArray, bounds: FloatArray, x: FloatArray, beyond: FloatArray) -> float:
    """Write rows @ x - bounds (r,) into `beyond`; return the greatest, -inf without rows."""
    worst = -float("inf")
    for i in range(len(bounds)):
        reached = -bounds[i]
        for j in range(len(x)):
            reached += rows[i, j] * x[j]
        beyond[i] = reached
        worst = max(worst, reached)
    return worst
