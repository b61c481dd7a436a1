"""The efficiency trade-off of the paper's case study."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.metrics import Sweep, efficiency_sweep
from wbc.robot import Robot
from wbc.view.palette import LIGHT, Theme
from wbc.view.plots.style import DASHES, drawing, new_figure


def tradeoff_figure(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    direction: ArrayLike = (0.0, 1.0),
    theme: Theme = LIGHT,
    axes: str = "xz",
) -> Figure:
    """Return what less efficient gears cost and bring along one direction (Sim & Ramos, IV.D).

    Panels over the forward efficiency of all gears: the wedge's backward efficiency; force that
    can be lifted and held over the force with perfect gears (left out where no motor limits it);
    for a floating base the impact
    mitigation factor (it is 1 for a base that cannot move).

    Args:
        robot: whose efficiencies are varied.
        position: q (nq,), not singular.
        contact: name of the contact point.
        direction: (n,) along `axes`.
        theme: page colours.
        axes: world axes.
    """
    eta = np.linspace(0.505, 1.0, 100)
    sweep = efficiency_sweep(robot, position, contact, direction, eta, axes=axes)
    limited = bool(np.isfinite(sweep.conventional).all())
    panels = 1 + limited + bool(robot.floating_size)
    with drawing(theme):
        figure, grid = new_figure(1, panels, 3.35 * panels, 3.1)
        _draw_relation(grid[0][0], robot, eta, theme)
        if limited:
            _draw_ratios(grid[0][1], sweep, theme)
        if robot.floating_size:
            _draw_mitigation(grid[0][-1], sweep, theme)
        for ax in grid[0]:
            ax.set_xlabel("forward efficiency $\\eta_f$ [-]")
            ax.set_xlim(0.5, 1.0)
    return figure


def _draw_relation(ax: Axes, robot: Robot, eta: FloatArray, theme: Theme) -> None:
    gears = robot.transmission
    forward, backward = gears.forward_efficiency, gears.backward_efficiency
    ax.plot(eta, 2.0 - 1.0 / eta, color=theme.series[1])
    ax.plot(eta, eta, color=theme.ink, linestyle=":", linewidth=1.0)
    ax.annotate(
        "$\\eta_b = \\eta_f$",
        (0.62, 0.62),
        xytext=(-30, 10),
        textcoords="offset points",
        fontsize=8,
    )
    ax.scatter(forward, backward, color=theme.ink, zorder=3, clip_on=False)  # 1 is the edge
    for f, b in dict.fromkeys(zip(forward.tolist(), backward.tolist(), strict=True)):
        same = np.flatnonzero((forward == f) & (backward == b))
        text = "\n".join(gears.joints[j] for j in same) if len(same) < gears.size else "all gears"
        ax.annotate(
            text, (f, b), xytext=(0, -7), ha="center", va="top",
            textcoords="offset points", fontsize=8,
        )  # fmt: skip
    ax.set_title("backward efficiency of the wedge")
    ax.set_ylabel("$\\eta_b$ [-]")


def _draw_ratios(ax: Axes, sweep: Sweep, theme: Theme) -> None:
    ax.plot(
        sweep.values, sweep.hold_ratio, color=theme.series[1], linestyle=DASHES[1], label="hold"
    )
    ax.plot(sweep.values, sweep.lift_ratio, color=theme.series[0], label="lift")
    ax.set_yscale("log")
    ax.set_yticks([0.5, 1, 2, 5, 10, 20, 50], ["0.5", "1", "2", "5", "10", "20", "50"])
    ax.set_title("force over force with perfect gears")
    ax.set_ylabel("ratio [-]")
    ax.legend()


def _draw_mitigation(ax: Axes, sweep: Sweep, theme: Theme) -> None:
    values = sweep.impact_mitigation
    ax.axhline(values[-1], color=theme.ink, linestyle=":", linewidth=1.0)
    ax.annotate(
        "perfect gears", (0.51, values[-1]), xytext=(0, 3), textcoords="offset points", fontsize=8
    )
    ax.plot(sweep.values, values, color=theme.series[2])
    ax.set_ylim(0.0, 1.0)
    ax.set_title("impact mitigation factor")
    ax.set_ylabel("IMF [-]")
