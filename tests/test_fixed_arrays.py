"""Arrays that compiled code finds by where they lie."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.compiled import Dense, Matrix, Nothing, OutRow, Places, Row, compiled
from wbc.fixed_arrays import FixedArrays, FixedTable, array_at

KINDS = Matrix, Row, Places, OutRow


@compiled(Nothing, FixedTable, Row)
def gather(memory: IntArray, x: FloatArray) -> None:
    """Write (A x + b) of the chosen rows into the last array."""
    A, b = array_at(memory, 0, Matrix), array_at(memory, 1, Row)
    chosen, result = array_at(memory, 2, Places), array_at(memory, 3, OutRow)
    for i in range(len(chosen)):
        total = b[chosen[i]]
        for j in range(A.shape[1]):
            total += A[chosen[i], j] * x[j]
        result[i] = total


@pytest.mark.parametrize("order", ["C", "F", "strided"])
def test_arrays_are_read_and_written_where_they_lie(order):
    generator = np.random.default_rng(0)
    A = np.asarray(generator.normal(size=(5, 3)), order=order if order != "strided" else "C")
    if order == "strided":
        A = generator.normal(size=(10, 7))[::2, 1:7:2]
    b, chosen, result = generator.normal(size=5), frozen([4, 0, 2], np.int_), np.zeros(3)
    fixed = FixedArrays(KINDS, (A, b, chosen, result))
    for _ in range(2):
        x = generator.normal(size=3)
        gather(fixed.table, x)
        np.testing.assert_allclose(result, (A @ x + b)[[4, 0, 2]], rtol=1e-14)
        A[:] = generator.normal(size=(5, 3))  # what stands there is read anew
        b[:] = 1.0


@pytest.mark.parametrize(
    ("kind", "array"),
    [
        (Row, np.zeros((2, 2))),
        (Row, np.zeros(4, dtype=np.float32)),
        (Row, np.zeros(8)[::2]),
        (Dense, np.zeros((3, 2)).T),
        (Places, np.zeros(3)),
        (OutRow, frozen(np.zeros(3))),
    ],
)
def test_an_array_of_another_kind_is_refused(kind, array):
    """Machine code would read memory that is not the array's."""
    with pytest.raises(TypeError):
        FixedArrays((kind,), (array,))
