"""The inequalities of a program that do not change with the state, each as row @ x <= bound."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.control.program.inequality_rows import InequalityRows
from wbc.control.solvers import INFINITE


class OneSidedRows:
    """Cones, normal forces and joint limits, two-sided rows as two that look opposite ways.

    Attributes:
        rows: (r, n).
        bounds: (r,), as `update` last found them.
        source: (r,) which row of the inequalities each one is.
        sign: (r,) +1 where it is the upper bound of that row, -1 where the lower.
    """

    def __init__(self, inequalities: InequalityRows) -> None:
        """Take the rows; cones have no lower bound."""
        self._inequalities, self._revision = inequalities, -1
        first, faces = inequalities.torque.stop, inequalities.cone.stop
        total = len(inequalities.lower)
        above, below = np.arange(first, total), np.arange(faces, total)
        self.source: IntArray = np.concatenate([above, below])
        self.sign = np.concatenate([np.ones(len(above)), -np.ones(len(below))])
        self.rows: FloatArray = inequalities.C[self.source] * self.sign[:, None]
        self.bounds = np.full(len(self.source), INFINITE)
        self._high, self._low = self.bounds[: len(above)], self.bounds[len(above) :]
        self._upper, self._lower = inequalities.upper[first:], inequalities.lower[faces:]

    def update(self) -> None:
        """Read the bounds of the inequalities, if they have changed."""
        if self._revision == self._inequalities.revision:
            return
        self._revision = self._inequalities.revision
        np.copyto(self._high, self._upper)
        np.negative(self._lower, out=self._low)
