"""A figure that a notebook shows as a picture, whatever its settings."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A figure without a window; as the last line of a cell it is a picture, not a name."""

    def _repr_png_(self) -> bytes:
        """Return the picture, as notebooks ask for it."""
        file = BytesIO()
        self.savefig(file, format="png", dpi=80)
        return file.getvalue()
