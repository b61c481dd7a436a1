"""Rows of tasks and contacts at one state, compiled."""

from __future__ import annotations

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Dense, Matrix, Nothing, OutVector, Places, Vector, compiled


@compiled(Nothing, Matrix, Vector, Places, OutVector)
def place_rates(
    jacobian: FloatArray, velocity: FloatArray, chosen: IntArray, rates: FloatArray
) -> None:
    """Write J v (k,) and below it the velocities of the chosen coordinates (c,) into `rates`."""
    rows = len(jacobian)
    for i in range(rows):
        rate = 0.0
        for j in range(len(velocity)):
            rate += jacobian[i, j] * velocity[j]
        rates[i] = rate
    for i in range(len(chosen)):
        rates[rows + i] = velocity[chosen[i]]


@compiled(Nothing, Dense, Dense, Places, Vector, OutVector, OutVector)
def place_wanted(
    parts: FloatArray,
    gains: FloatArray,
    chosen: IntArray,
    weight: FloatArray,
    wanted: FloatArray,
    pull: FloatArray,
) -> None:
    """Write the sum of gains * parts over their first axis (k + c,) into `wanted`.

    The last c of them, of the chosen coordinates, are summed by weight (c,) into `pull` (nv,).
    """
    total = len(wanted)
    rows = total - len(chosen)
    wanted[:] = 0.0
    for part in range(len(parts)):
        for i in range(total):
            wanted[i] += gains[part, i] * parts[part, i]
    pull[:] = 0.0
    for i in range(len(chosen)):
        pull[chosen[i]] += weight[i] * wanted[rows + i]


@compiled(Nothing, Matrix, Vector, Vector, Vector, OutVector)
def place_rest(
    jacobian: FloatArray,
    velocity: FloatArray,
    damping: FloatArray,
    drift: FloatArray,
    target: FloatArray,
) -> None:
    """Write -damping J v - drift (k,), the acceleration that brings rows to rest, into `target`."""
    for i in range(len(target)):
        rate = 0.0
        for j in range(len(velocity)):
            rate += jacobian[i, j] * velocity[j]
        target[i] = -damping[i] * rate - drift[i]
