"""Marks that several plots share."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from wbc.arrays import FloatArray
from wbc.transmission import Direction
from wbc.view.palette import DIRECTION_COLOURS, DIRECTION_LABELS
from wbc.view.quantities.impacts import RecordedImpact


def fill_power(axes: Axes, time: FloatArray, power: FloatArray, directions: FloatArray) -> None:
    """Fill the area between a power and zero in the colour of its direction."""
    for mode in Direction:
        axes.fill_between(
            time,
            power,
            where=directions == mode,
            color=DIRECTION_COLOURS[mode],
            alpha=0.75,
            linewidth=0.0,
            step="mid",
        )


def direction_patches() -> list[Patch]:
    """Return the legend entries of the directions of power."""
    modes = (Direction.FORWARD, Direction.BACKWARD, Direction.STUCK)
    return [Patch(color=DIRECTION_COLOURS[m], alpha=0.75, label=DIRECTION_LABELS[m]) for m in modes]


def mark_impacts(axes: Axes, impacts: Sequence[RecordedImpact], colour: str) -> None:
    """Draw a thin line at every impact."""
    for impact in impacts:
        axes.axvline(impact.time, color=colour, linewidth=0.8, linestyle=(0, (2, 2)))
