"""Keeping every M-th row without aliasing, on rows that arrive in pieces."""

from __future__ import annotations

import numpy as np
from scipy.signal import firwin, upfirdn

from wbc.arrays import FloatArray

_HALF_LENGTH = 8
_PASS_BAND = 0.8


class Decimator:
    """Symmetric low-pass (no phase shift, unit gain at zero) and row reduction by a factor.

    The windowed-sinc filter passes up to 0.8 of the new Nyquist frequency and spans 8 new samples
    either way. It acts on the time stamps too, so that jitter is averaged with the values. Ends are
    extended by point reflection, which keeps straight lines straight.
    """

    def __init__(self, factor: int) -> None:
        """Choose the factor M >= 1; 1 keeps every row as it is."""
        self.factor = factor
        self._reach = _HALF_LENGTH * factor
        self._taps = firwin(2 * self._reach + 1, _PASS_BAND / factor) if factor > 1 else None
        self._buffer: FloatArray | None = None

    def push(self, rows: FloatArray) -> FloatArray:
        """Take the next rows (n, k) and return the reduced rows that they complete, (m, k)."""
        if self._taps is None:
            return rows
        if self._buffer is None or self._buffer.shape[0] <= self._reach:
            rows = rows if self._buffer is None else np.concatenate([self._buffer, rows])
            self._buffer = rows
            if rows.shape[0] <= self._reach:
                return rows[:0]
            self._buffer = np.concatenate([2.0 * rows[0] - rows[self._reach : 0 : -1], rows])
        else:
            self._buffer = np.concatenate([self._buffer, rows])
        return self._reduce()

    def finish(self) -> FloatArray:
        """Return the last reduced rows, (m, k)."""
        if self._taps is None or self._buffer is None:
            return np.zeros((0, 0))
        if self._buffer.shape[0] <= self._reach:
            return self._buffer[:: self.factor]
        end = 2.0 * self._buffer[-1] - self._buffer[-2 : -self._reach - 2 : -1]
        self._buffer = np.concatenate([self._buffer, end])
        return self._reduce()

    def _reduce(self) -> FloatArray:
        """Filter what is complete, and keep the rows that later outputs still need."""
        held = self._buffer
        if held is None or held.shape[0] < 2 * self._reach + 1:
            return np.zeros((0, 0 if held is None else held.shape[1]))
        full = upfirdn(self._taps, held, up=1, down=self.factor, axis=0)
        first = 2 * _HALF_LENGTH
        last = (held.shape[0] - 1) // self.factor
        self._buffer = held[(last - first + 1) * self.factor :]
        return np.asarray(full[first : last + 1])
