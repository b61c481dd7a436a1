"""Mesh power and losses of every gear."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.palette import LIGHT, Theme
from wbc.view.plots.noisy import display_window
from wbc.view.plots.shading import direction_patches, fill_power, mark_impacts
from wbc.view.plots.style import drawing, new_figure
from wbc.view.quantities.gear_flow import gear_flow
from wbc.view.quantities.impacts import log_impacts


def power_figure(robot: Robot, log: Log, theme: Theme = LIGHT) -> Figure:
    """Return mesh power by direction and the heat it leaves, one row per gear.

    Powers are means over a 150th of the log, never across an impact: sensor noise makes
    the power of single ticks change its sign, which would hide whether motor or joint drives.

    Args:
        robot: whose efficiencies give the losses.
        log: with rotor torques.
        theme: page colours.
    """
    gears = robot.transmission
    flow = gear_flow(robot, log, display_window(log.time))
    impacts = log_impacts(robot, log)
    with drawing(theme):
        figure, grid = new_figure(gears.size, 2, 9.0, 2.1 * gears.size + 0.6, share_x=True)
        for i, joint in enumerate(gears.joints):
            power, loss = grid[i]
            fill_power(power, log.time, flow.mesh_power[:, i], flow.direction[:, i])
            power.plot(log.time, flow.mesh_power[:, i], color=theme.ink, linewidth=0.5)
            power.set_title(f"{joint}: power into the teeth")
            heat = np.concatenate(
                [[0.0], np.cumsum(0.5 * (flow.loss[1:, i] + flow.loss[:-1, i]) * np.diff(log.time))]
            )
            loss.fill_between(
                log.time, flow.loss[:, i], color=theme.series[5], alpha=0.5, linewidth=0.0
            )
            loss.plot(log.time, flow.loss[:, i], color=theme.series[5], linewidth=0.9)
            total = loss.twinx()
            total.plot(log.time, heat, color=theme.series[1])
            total.set_ylabel("heat so far [J]", color=theme.series[1])
            total.tick_params(axis="y", colors=theme.series[1])
            total.grid(visible=False)
            total.set_ylim(bottom=0.0)
            loss.set_ylim(bottom=0.0)
            loss.set_title(
                f"{joint}: loss ($\\eta_f$ = {gears.forward_efficiency[i]:.2f}, "
                f"$\\eta_b$ = {gears.backward_efficiency[i]:.2f})"
            )
            for ax in (power, loss):
                ax.set_ylabel("power [W]")
                mark_impacts(ax, impacts, theme.ink)
        for ax in grid[-1]:
            ax.set_xlabel("time [s]")
            ax.set_xlim(log.time[0], log.time[-1])
        figure.legend(handles=direction_patches(), loc="outside upper center", ncols=3)
    return figure
