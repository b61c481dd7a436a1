"""Naming world axes by letters."""

from __future__ import annotations

from wbc.errors import ControlError


def axis_rows(axes: str, task: str) -> list[int]:
    """Return the rows that the letters of `axes` name.

    Raises:
        ControlError: no letter, a letter other than x, y, z, or one twice.
    """
    if not axes or len(set(axes)) != len(axes) or not set(axes) <= set("xyz"):
        raise ControlError(
            f"task '{task}': axes must be some of 'x', 'y', 'z', each once, got '{axes}'."
        )
    return ["xyz".index(letter) for letter in axes]
