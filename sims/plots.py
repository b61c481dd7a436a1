"""A row of panels with lines and points: what a sweep looks like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike

from wbc.view import LIGHT

Curves = Mapping[str, tuple[ArrayLike, ArrayLike]]

# Line styles repeat what colours say, for a print in grey.
_DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (5, 1.5, 1, 1.5)))
_STYLE = {
    "figure.facecolor": LIGHT.page,
    "axes.facecolor": LIGHT.panel,
    "axes.edgecolor": LIGHT.ink,
    "axes.labelcolor": LIGHT.ink,
    "axes.titlecolor": LIGHT.ink,
    "text.color": LIGHT.ink,
    "xtick.color": LIGHT.ink,
    "ytick.color": LIGHT.ink,
    "grid.color": LIGHT.faint,
    "grid.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.labelsize": 9,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
}


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
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(3.7 * columns, 3.2 * rows), layout="constrained")
        FigureCanvasAgg(figure)
        axes = list(np.ravel(figure.subplots(rows, columns, squeeze=False)))
        for ax, panel in zip(axes, panels, strict=False):
            for i, (label, (x, y)) in enumerate(panel.lines.items()):
                ax.plot(x, y, color=LIGHT.series[i], linestyle=_DASHES[i], label=label or None)
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
