"""How every plot looks: one style, two pages, no display."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wbc.errors import ViewError
from wbc.files import atomic_write
from wbc.view.palette import LIGHT, Theme

_FORMATS = ("png", "pdf", "svg")
# Line styles repeat what colours say, for a print in grey.
DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (8, 2)), (0, (3, 1)))


@contextmanager
def drawing(theme: Theme = LIGHT) -> Iterator[None]:
    """Draw in the style of a theme inside a `with` block."""
    settings = {
        "figure.facecolor": theme.page,
        "axes.facecolor": theme.panel,
        "axes.edgecolor": theme.ink,
        "axes.labelcolor": theme.ink,
        "axes.titlecolor": theme.ink,
        "text.color": theme.ink,
        "xtick.color": theme.ink,
        "ytick.color": theme.ink,
        "grid.color": theme.faint,
        "grid.linewidth": 0.6,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.linewidth": 0.8,
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.titleweight": "bold",
        "axes.labelsize": 9,
        "xtick.labelsize": 8,
        "ytick.labelsize": 8,
        "legend.fontsize": 8,
        "legend.frameon": False,
        "lines.linewidth": 1.4,
        "font.family": "DejaVu Sans",
    }
    with mpl.rc_context(settings):
        yield


def new_figure(
    rows: int,
    columns: int,
    width: float,
    height: float,
    *,
    share_x: bool = False,
    heights: Sequence[float] | None = None,
) -> tuple[Figure, list[list[Axes]]]:
    """Return a figure of `width` x `height` inches and its axes, row by row.

    Args:
        rows, columns: of axes.
        width, height: [inch].
        share_x: one x axis per column.
        heights: (rows,) relative heights; all alike when left out.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(
        rows, columns, squeeze=False, sharex="col" if share_x else False, height_ratios=heights
    )
    return figure, [list(row) for row in np.asarray(axes)]


def write_figure(path: str | Path, figure: Figure, resolution: float = 160.0) -> Path:
    """Write a figure; the ending of `path` (png, pdf, svg) decides the format.

    Args:
        path: the file (written whole or not at all).
        figure: any figure of this package.
        resolution: [dots per inch] of a PNG.

    Raises:
        ViewError: another ending.
    """
    kind = Path(path).suffix.lstrip(".").lower()
    if kind not in _FORMATS:
        raise ViewError(f"'{path}': a plot ends in {', '.join('.' + name for name in _FORMATS)}.")
    if figure.get_layout_engine() is not None:
        # Laid out once: another round would move parts by a hair and make equal plots unequal.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
    # A date or a random name in the file would make equal plots unequal.
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    with mpl.rc_context({"svg.hashsalt": "wbc", "svg.fonttype": "none"}):
        return atomic_write(
            path, lambda file: figure.savefig(file, format=kind, dpi=resolution, metadata=metadata)
        )


def legend_above(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend of `axes` above the whole figure."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)
