"""Where a model fails, and what its effects repair."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from wbc.arrays import FloatArray
from wbc.view.palette import LIGHT, Theme
from wbc.view.residuals import LogResiduals
from wbc.view.style import drawing, new_figure

_POINTS = 1500


def residual_figure(residuals: LogResiduals, fitted_label: str, theme: Theme = LIGHT) -> Figure:
    """Return the residual of every driven joint over time, speed, position and load.

    Points are measured minus modelled torque of the robot that was given and of the robot with
    the effects found; the band is two noise floors. Where the quantity on the axis decides what
    the effects explain, a line shows it (the difference of the two, averaged in bins; one line per
    direction of motion where that takes two).

    Args:
        residuals: from `residuals_of`.
        fitted_label: what the robot with the effects is called in the legend.
        theme: page colours.
    """
    run = residuals.runs[0]
    dots: dict[str, Any] = {"s": 4, "linewidths": 0, "rasterized": True, "alpha": 0.45}
    with drawing(theme):
        figure, grid = new_figure(residuals.driven, 4, 12.0, 2.3 * residuals.driven + 0.6)
        for k, axes in enumerate(grid):
            _over_time(axes[0], run.time, run.before[:, k], run.after[:, k], theme)
            label = f"measured - model [{residuals.units[k]}]"
            axes[0].set(title=residuals.outputs[k], xlabel="time [s]", ylabel=label)
            for ax in axes[1:]:
                ax.set_visible(False)
            before, after = (residuals.stacked(name, k) for name in ("before", "after"))
            few = slice(None, None, max(1, len(before) // _POINTS))
            for ax, (name, unit, x, curves) in zip(axes[1:], residuals.over(k), strict=False):
                ax.set(xlabel=f"{name} [{unit}]", visible=True)
                ax.scatter(x[few], before[few], color=theme.series[1], **dots)
                ax.scatter(x[few], after[few], color=theme.series[0], **dots)
                for curve in curves:
                    ax.plot(*curve, color=theme.series[2], linewidth=1.6)
            for ax in axes:
                level = 2.0 * residuals.floor[k]
                ax.axhspan(-level, level, color=theme.ink, alpha=0.13, linewidth=0.0)
        entries = [
            Line2D([], [], color=theme.series[1], marker="o", linestyle="", label="as given"),
            Line2D([], [], color=theme.series[0], marker="o", linestyle="", label=fitted_label),
            Line2D([], [], color=theme.series[2], label="what the effects explain"),
            Patch(color=theme.ink, alpha=0.13, label="two noise floors"),
        ]
        figure.legend(handles=entries, loc="outside upper center", ncols=4)
    return figure


def unexplained_figure(residuals: LogResiduals, fitted_label: str, theme: Theme = LIGHT) -> Figure:
    """Return the torque of every driven joint that the model leaves unexplained, over time.

    The title of a panel gives its root mean square before and after, over all logs.

    Args:
        residuals: from `residuals_of`.
        fitted_label: what the robot with the effects is called in the legend.
        theme: page colours.
    """
    run, rows = residuals.runs[0], residuals.driven
    with drawing(theme):
        figure, grid = new_figure(rows, 1, 7.5, 1.7 * rows + 0.8, share_x=True)
        for k, (ax,) in enumerate(grid):
            _over_time(ax, run.time, run.before[:, k], run.after[:, k], theme, 1.4)
            before, after = (
                float(np.sqrt(np.mean(residuals.stacked(side, k) ** 2)))
                for side in ("before", "after")
            )
            unit, name = residuals.units[k], residuals.outputs[k]
            title = f"{name}: {before:.2g} {unit} unexplained, then {after:.1g} {unit}"
            ax.set(title=title, ylabel=f"measured - model\n[{unit}]")
        grid[-1][0].set_xlabel("time [s]")
        entries = [
            Line2D([], [], color=theme.series[1], label="model as given"),
            Line2D([], [], color=theme.series[0], label=fitted_label),
        ]
        figure.legend(handles=entries, loc="outside upper center", ncols=2)
    return figure


def staircase_figure(
    steps: list[tuple[str, float]], floor_source: str, theme: Theme = LIGHT
) -> Figure:
    """Return the held-out error after each addition, in noise floors.

    Args:
        steps: (what was added, error), the first one for the robot as given.
        floor_source: `repeats` or `lower bound`.
        theme: page colours.
    """
    errors = np.array([error for _, error in steps])
    with drawing(theme):
        figure, grid = new_figure(1, 1, 6.5, 0.55 * len(steps) + 1.2)
        ax = grid[0][0]
        rows = np.arange(len(steps))
        ax.barh(rows, errors, color=theme.series[0], height=0.62)
        # From zero and linear: the length of a bar is the error, twice as long is twice as much.
        ax.set_xlim(0.0, 1.12 * max(errors.max(), 2.0))
        ax.axvline(1.0, color=theme.series[1], linestyle="--")
        beside: dict[str, Any] = {"textcoords": "offset points"}
        text = f"1 = noise floor ({floor_source})"
        ax.annotate(text, (1.0, -0.62), (3, 0), color=theme.series[1], fontsize=8, **beside)
        for row, error in zip(rows, errors, strict=True):
            ax.annotate(f"{error:.3g}", (error, row), (4, 0), va="center", fontsize=8.5, **beside)
        ax.set_yticks(rows, [label for label, _ in steps])
        ax.set_ylim(len(steps) - 0.4, -0.8)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("held-out error [noise floors]")
    return figure


def _over_time(
    ax: Axes,
    time: FloatArray,
    before: FloatArray,
    after: FloatArray,
    theme: Theme,
    width: float = 0.8,
) -> None:
    ax.plot(time, before, color=theme.series[1], linewidth=width)
    ax.plot(time, after, color=theme.series[0], linewidth=width)
    ax.set_xlim(time[0], time[-1])
