"""A row of panels with lines and points: what a sweep looks like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wbc.view import LIGHT, Theme
from wbc.view.plots import DASHES, drawing, panel_figure, write_figure
from wbc.view.study_figures import plain_decades

Curves = Mapping[str, tuple[ArrayLike, ArrayLike]]


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes:
        title, across, up: what stands above, below and beside.
        lines: label -> (x, y), drawn as lines.
        points: label -> (x, y), drawn as dots, the first ones largest; those that a line's label
            names have its colour.
        dots: what such dots are called in the legend.
        log: whether the upward axis is logarithmic.
    """

    title: str
    across: str
    up: str
    lines: Curves
    points: Curves = field(default_factory=dict)
    log: bool = False
    dots: str = ""


def sweep_figure(panels: Sequence[Panel], columns: int = 3, theme: Theme = LIGHT) -> Figure:
    """Return the panels side by side, `columns` in a row."""
    with drawing(theme):
        figure, axes = panel_figure(len(panels), columns, 3.7, 3.2)
        for ax, panel in zip(axes, panels, strict=True):
            _draw(ax, panel, theme)
            ax.set(title=panel.title, xlabel=panel.across, ylabel=panel.up)
            if panel.log:
                ax.set_yscale("log")
                plain_decades(ax.yaxis)
            if ax.get_legend_handles_labels()[0]:
                ax.legend()
    return figure


def _draw(ax: Axes, panel: Panel, theme: Theme) -> None:
    colours = dict(zip({**panel.lines, **panel.points}, theme.series, strict=False))
    for i, (label, (x, y)) in enumerate(panel.lines.items()):
        ax.plot(x, y, color=colours[label], linestyle=DASHES[i], label=label or None)
    for i, (label, (x, y)) in enumerate(panel.points.items()):
        own = None if label in panel.lines else label or None
        size = 5.0 + 3.0 * (len(panel.points) - 1 - i)  # of equal values each shows as a ring
        ax.plot(x, y, "o", color=colours[label], markersize=size, label=own)
    if panel.dots:
        ax.plot([], [], "o", color=theme.ink, markersize=5.0, label=panel.dots)


def write_figures(folder: Path, figures: Mapping[str, Figure]) -> list[Path]:
    """Write every figure as `folder/name.png` and return the files."""
    return [write_figure(folder / f"{name}.png", figure) for name, figure in figures.items()]
