"""How every plot looks: one style, two pages, no display."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wbc.errors import ViewError
from wbc.files import atomic_write
from wbc.identification.answer.figure import ShownFigure
from wbc.view.palette import LIGHT, Theme

_FORMATS = ("png", "pdf", "svg")
_RESOLUTION = 160.0  # [dots per inch] of a PNG
# Line styles repeat what colours say, for a print in grey.
DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (8, 2)), (0, (3, 1)))


@contextmanager
def drawing(theme: Theme = LIGHT) -> Iterator[None]:
    """Draw in the style of a theme inside a `with` block."""
    inked = ("axes.edgecolor", "axes.labelcolor", "axes.titlecolor", "text.color")
    settings = {
        "figure.facecolor": theme.page,
        "axes.facecolor": theme.panel,
        **dict.fromkeys((*inked, "xtick.color", "ytick.color"), theme.ink),
        "grid.color": theme.faint,
        "grid.linewidth": 0.6,
        **dict.fromkeys(("axes.grid", "axes.axisbelow"), True),
        **dict.fromkeys(("axes.spines.top", "axes.spines.right", "legend.frameon"), False),
        "axes.linewidth": 0.8,
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.titleweight": "bold",
        "axes.labelsize": 9,
        **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), 8),
        "lines.linewidth": 1.4,
        "font.family": "DejaVu Sans",
    }
    with mpl.rc_context(settings):
        yield


def new_figure(
    rows: int, columns: int, width: float, height: float, *, share_x: bool = False
) -> tuple[Figure, list[list[Axes]]]:
    """Return a figure of `width` x `height` inches and its axes, row by row.

    Args:
        rows, columns: of axes.
        width, height: [inch].
        share_x: one x axis per column.
    """
    figure = ShownFigure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, sharex="col" if share_x else False)
    return figure, axes.tolist()


def panel_figure(
    count: int, columns: int, width: float, height: float
) -> tuple[Figure, list[Axes]]:
    """Return a figure with `count` panels of `width` x `height` inches, `columns` in a row.

    Args:
        count, columns: of panels.
        width, height: of each [inch].
    """
    rows = -(-count // columns)
    figure, grid = new_figure(rows, columns, width * columns, height * rows)
    axes = [ax for row in grid for ax in row]
    for ax in axes[count:]:
        ax.set_visible(False)
    return figure, axes[:count]


def write_figure(path: str | Path, figure: Figure) -> Path:
    """Write a figure; the ending of `path` (png, pdf, svg) decides the format.

    Args:
        path: the file (written whole or not at all).
        figure: any figure of this package.

    Raises:
        ViewError: another ending.
    """
    kind = Path(path).suffix.lstrip(".").lower()
    if kind not in _FORMATS:
        raise ViewError(f"'{path}': a plot ends in {', '.join('.' + name for name in _FORMATS)}.")
    if (layout := figure.get_layout_engine()) is not None:
        # Laid out once: another round would move parts by a hair and make equal plots unequal.
        layout.execute(figure)
        figure.set_layout_engine("none")
    # A date or a random name in the file would make equal plots unequal.
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    look: dict[str, Any] = {"format": kind, "dpi": _RESOLUTION, "metadata": metadata}
    with mpl.rc_context({"svg.hashsalt": "wbc", "svg.fonttype": "none"}):
        return atomic_write(path, lambda file: figure.savefig(file, **look))


def legend_above(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend of `axes` above the whole figure."""
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=columns)
