"""Rows that repeat each other, as independent ones of the same least-squares solution."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.program.rows.orthonormal_rows import extend_basis

# Directions that move the rows less than this share are left to the tasks: near such a pose a
# metre per second squared at the rows would ask a million of the joints.
_WEAK = 1e-6


class RowBasis:
    """An orthonormal basis B of the rows of J, with B qdd = y where y minimises |J B' y - t|^2.

    Points of one rigid body can move only as it does. What is asked of them differs from that by
    rounding, by noise of the velocities (w x (w x r) sets two points apart) and by their own
    gains; as equalities such rows would contradict each other, their least-squares solution
    exists.
    """

    def __init__(self, rows: int, columns: int, rank: int) -> None:
        """Make room for J (rows, columns) with `rank` independent rows."""
        self._left, self._kept = np.zeros((rows, columns)), np.zeros((rows, columns))
        self._rank = rank

    def place(
        self,
        jacobian: FloatArray,
        target: FloatArray,
        rows: FloatArray,
        right: FloatArray,
        softness: FloatArray,
    ) -> None:
        """Write the basis and its right-hand side.

        Where a pose leaves fewer independent rows, the rest ask nothing: 0 = 0, with a softness
        that keeps the solver's system regular.

        Args:
            jacobian, target: J (k, nv) and t (k,).
            rows, right, softness: results (r, nv), (r,), (r,).
        """
        count = min(extend_basis(jacobian, self._left, self._kept, 0), self._rank)
        basis = self._kept[:count]
        rows[:count], rows[count:] = basis, 0.0
        right[:] = 0.0
        right[:count] = np.linalg.lstsq(jacobian @ basis.T, target, rcond=_WEAK)[0]
        softness[:count], softness[count:] = 0.0, 1.0
