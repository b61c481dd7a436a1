"""One impact, looked at closely."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wbc.errors import ViewError
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.palette import LIGHT, Theme
from wbc.view.plots.noisy import plot_mean
from wbc.view.plots.style import DASHES, drawing, legend_above, new_figure
from wbc.view.quantities.averaging import jump_rows
from wbc.view.quantities.channels import contact_forces
from wbc.view.quantities.gear_flow import gear_flow
from wbc.view.quantities.impacts import log_impacts, robot_weight

_QUANTITY = {"N": "force", "N s": "impulse", "rad/s": "speed", "W": "power"}


def impact_figure(
    robot: Robot,
    runs: Mapping[str, Log],
    *,
    before: float = 0.05,
    after: float = 0.25,
    theme: Theme = LIGHT,
) -> Figure:
    """Return ground force, gear speeds and mesh power around the first impact of every run.

    The force axis is linear up to the weight and logarithmic above, so that the blow and the
    standing force both show. The impulse counts from the impact and without the weight's share: it
    ends at the momentum that the robot brought.

    Args:
        robot: the robot of all runs.
        runs: label -> recording; time 0 of the plot is each run's own impact.
        before, after: [s] shown around it.
        theme: page colours.

    Raises:
        ViewError: a run without an impact.
    """
    gears = robot.transmission
    with drawing(theme):
        rows = 1 + gears.size
        figure, grid = new_figure(rows, 2, 8.0, 1.7 * rows + 0.5, share_x=True)
        for i, (label, log) in enumerate(runs.items()):
            impacts = log_impacts(robot, log)
            if not impacts:
                raise ViewError(f"no contact force of '{label}' rises out of the air: no impact.")
            begin = impacts[0].time
            style: dict[str, Any] = {
                "color": theme.series[i % len(theme.series)],
                "linestyle": DASHES[i % len(DASHES)],
                "label": label,
            }
            _plot_run(grid, robot, log.between(begin - before, begin + after), begin, style)
        _label(grid, gears.joints, theme)
        for ax in grid[-1]:
            ax.set_xlim(-1e3 * before, 1e3 * after)
        if len(runs) > 1:
            legend_above(figure, grid[0][0], len(runs))
    return figure


def _plot_run(
    grid: list[list[Axes]], robot: Robot, log: Log, begin: float, style: dict[str, Any]
) -> None:
    time, weight = 1e3 * (log.time - begin), robot_weight(robot)
    vertical = np.sum([force[:, 2] for force in contact_forces(robot, log).values()], axis=0)
    grid[0][0].plot(time, vertical, **style)
    grid[0][0].set_yscale("symlog", linthresh=weight, linscale=1.0)
    grid[0][0].yaxis.set_major_formatter("{x:g}")
    since = log.time >= begin - 0.5 * log.sample_time
    beyond = np.where(since, vertical - weight, 0.0)
    grid[0][1].plot(time, np.cumsum(beyond) * log.sample_time, **style)
    flow = gear_flow(robot, log)
    jumps = jump_rows(flow.speed, [int(np.searchsorted(log.time, begin))])
    for k, (left, right) in enumerate(grid[1:]):
        left.plot(time, flow.speed[:, k], **style)
        plot_mean(right, time, flow.mesh_power[:, k], style, jumps)


def _label(grid: list[list[Axes]], joints: tuple[str, ...], theme: Theme) -> None:
    titles = [("vertical ground force", "N", "impulse of the ground beyond the weight", "N s")]
    titles += [
        (f"speed of the {joint} gear", "rad/s", f"mesh power, {joint}", "W") for joint in joints
    ]
    for row, (left, left_unit, right, right_unit) in zip(grid, titles, strict=True):
        for ax, title, unit in ((row[0], left, left_unit), (row[1], right, right_unit)):
            ax.set_title(title)
            ax.set_ylabel(f"{_QUANTITY[unit]} [{unit}]")
            ax.axvline(0.0, color=theme.ink, linewidth=0.8, linestyle=(0, (2, 2)))
    for ax in grid[-1]:
        ax.set_xlabel("time after the impact [ms]")
