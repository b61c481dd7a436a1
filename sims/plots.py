"""A row of panels with lines and points: what a sweep looks like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike

from wbc.view import LIGHT
from wbc.view.plots import DASHES, drawing, new_figure

Curves = Mapping[str, tuple[ArrayLike, ArrayLike]]


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes:
        title, across, up: what stands above, below and beside.
        lines: label -> (x, y), drawn as lines.
        points: label -> (x, y), drawn as marks.
        log: whether the upward axis is logarithmic.
    """

    title: str
    across: str
    up: str
    lines: Curves
    points: Curves = field(default_factory=dict)
    log: bool = False


def sweep_figure(panels: Sequence[Panel], columns: int = 3) -> Figure:
    """Return the panels side by side, `columns` in a row."""
    rows = -(-len(panels) // columns)
    with drawing():
        figure, grid = new_figure(rows, columns, 3.7 * columns, 3.2 * rows)
        axes = [ax for row in grid for ax in row]
        for ax, panel in zip(axes, panels, strict=False):
            for i, (label, (x, y)) in enumerate(panel.lines.items()):
                ax.plot(x, y, color=LIGHT.series[i], linestyle=DASHES[i], label=label or None)
            for i, (label, (x, y)) in enumerate(panel.points.items(), len(panel.lines)):
                ax.plot(x, y, "o", color=LIGHT.series[i], markersize=4.5, label=label or None)
            ax.set(title=panel.title, xlabel=panel.across, ylabel=panel.up)
            if panel.log:
                ax.set_yscale("log")
                ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                ax.yaxis.set_major_formatter(FormatStrFormatter("%g"))
                ax.yaxis.set_minor_formatter(NullFormatter())
            if any([*panel.lines, *panel.points]):
                ax.legend()
        for ax in axes[len(panels) :]:
            ax.set_visible(False)
    return figure
