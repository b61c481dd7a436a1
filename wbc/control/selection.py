"""Rows as slices where they can be."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from wbc.arrays import IntArray

Rows: TypeAlias = slice | IntArray
"""Row numbers, or the slice that means the same."""


def as_rows(rows: IntArray) -> Rows:
    """Return the rows as a slice where they are evenly spaced: views instead of copies."""
    if not rows.size:
        return rows
    start, step = int(rows[0]), int(rows[1] - rows[0]) if rows.size > 1 else 1
    if step > 0 and np.array_equal(rows, start + step * np.arange(rows.size)):
        return slice(start, int(rows[-1]) + 1, step)
    return rows
