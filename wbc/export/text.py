"""Numbers as text that reads back as the same numbers."""

from __future__ import annotations

from collections.abc import Iterable

from wbc.arrays import FloatArray
from wbc.robot import Robot


def number(value: float) -> str:
    """Return a number so that it reads back the same."""
    return repr(float(value) + 0.0)


def numbers(values: Iterable[float]) -> str:
    """Return numbers with blanks between them."""
    return " ".join(number(value) for value in values)


def per_joint(robot: Robot, values: FloatArray) -> dict[str, float]:
    """Return the driven joints' names -> values (m,)."""
    return dict(zip(robot.transmission.joints, map(float, values), strict=True))
