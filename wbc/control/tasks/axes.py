"""Naming world axes by letters."""

from __future__ import annotations

from itertools import pairwise

from wbc.errors import ControlError


def axis_rows(axes: str, task: str) -> slice:
    """Return the rows that the letters of `axes` name, as a slice: views instead of copies.

    Raises:
        ControlError: no letter, one other than x, y, z, one twice, or not in this order.
    """
    rows = ["xyz".find(letter) for letter in axes]
    if not rows or min(rows) < 0 or any(a >= b for a, b in pairwise(rows)):
        raise ControlError(
            f"task '{task}': axes must be some of 'x', 'y', 'z' in this order, got '{axes}'."
        )
    step = rows[1] - rows[0] if len(rows) > 1 else 1
    return slice(rows[0], rows[-1] + 1, step)
