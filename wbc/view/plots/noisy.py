"""Lines through signals that noise shakes: the mean in front, every sample faintly behind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from wbc.arrays import FloatArray
from wbc.view.quantities.averaging import window_mean

_SHARE = 1.0 / 150.0
_ROUGH = 0.1


def display_window(time: FloatArray) -> float:
    """Return the time [s] over which a plot of this span can average without hiding anything."""
    return float(time[-1] - time[0]) * _SHARE


def plot_mean(
    axes: Axes,
    time: FloatArray,
    values: FloatArray,
    style: Mapping[str, Any],
    jumps: Sequence[int] = (),
    *,
    samples: bool = True,
) -> None:
    """Draw a signal (N,), and where it is rough its mean in front of all its samples.

    Args:
        axes: to draw on.
        time: (N,) [s].
        values: (N,).
        style: of the line.
        jumps: rows that start anew; nothing is averaged across them.
        samples: whether the samples of a rough signal are drawn; several such signals hide one
            another.
    """
    rows = round(len(time) * _SHARE)
    mean = window_mean(values, rows, jumps)
    rough = float(np.nanstd(values - mean)) > _ROUGH * float(np.nanstd(values))
    if not rough:
        axes.plot(time, values, **style)
        return
    if samples:
        axes.plot(time, values, color=style.get("color"), linewidth=0.5, alpha=0.25, zorder=1.5)
    axes.plot(time, mean, **style)
