"""Rows as slices where they can be."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from wbc.arrays import IntArray

Rows: TypeAlias = slice | IntArray
"""Row numbers, or the slice that means the same."""


def as_rows(rows: IntArray) -> Rows:
    """Return the rows as a slice where they are consecutive: views instead of copies."""
    if rows.size and np.array_equal(rows, np.arange(rows[0], rows[0] + rows.size)):
        return slice(int(rows[0]), int(rows[0]) + int(rows.size))
    return rows
