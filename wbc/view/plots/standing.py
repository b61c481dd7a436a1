"""Standing and squatting: several closed loops on one page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wbc.arrays import FloatArray
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.palette import LIGHT, Theme
from wbc.view.plots.noisy import plot_mean
from wbc.view.plots.shading import mark_impacts
from wbc.view.plots.style import DASHES, drawing, legend_above, new_figure
from wbc.view.quantities.channels import configuration, contact_forces, rotor_torque
from wbc.view.quantities.impacts import log_impacts, robot_weight

_CUT = 4.0  # weights at which the axis of the force ends where something lands
_QUANTITY = {"m": "height", "mm": "sway", "deg": "pitch", "N m": "torque", "N": "force"}


def standing_figure(
    robot: Robot,
    runs: Mapping[str, Log],
    height_reference: tuple[FloatArray, FloatArray] | None = None,
    theme: Theme = LIGHT,
) -> Figure:
    """Return height, sway and pitch of the centre of mass and base, rotor torques and ground force.

    Torque and force that noise shakes are shown as their mean, of a single run in front of every
    sample. Where something lands the axis of the force ends at four weights.

    Args:
        robot: the robot of all runs (its links; the gears may differ from run to run).
        runs: label -> recording.
        height_reference: times (K,) [s] and heights (K,) [m] that the centre of mass should have.
        theme: page colours.
    """
    gears = robot.transmission
    with drawing(theme):
        rows = 3 + gears.size + 1
        figure, grid = new_figure(rows, 1, 7.0, 1.25 * rows + 0.6, share_x=True)
        axes = [row[0] for row in grid]
        if height_reference is not None:
            axes[0].plot(
                *height_reference, color=theme.ink, linewidth=2.6, alpha=0.3, label="reference"
            )
        for i, (label, log) in enumerate(runs.items()):
            _plot_run(axes, robot, log, run_style(i, label, theme), alone=len(runs) == 1)
        first = next(iter(runs.values()))
        impacts = [impact for log in runs.values() for impact in log_impacts(robot, log)]
        for ax in axes:
            mark_impacts(ax, log_impacts(robot, first), theme.ink)
        titles = ["height of the centre of mass", "sway of the centre of mass", "pitch of the base"]
        units = ["m", "mm", "deg"]
        titles += [f"rotor torque, {joint}" for joint in gears.joints] + ["vertical ground force"]
        units += ["N m"] * gears.size + ["N"]
        for ax, title, unit in zip(axes, titles, units, strict=True):
            ax.set_title(title)
            ax.set_ylabel(f"{_QUANTITY[unit]} [{unit}]")
        if impacts:
            # The force of an impact would flatten all others.
            axes[-1].set_ylim(-0.1 * robot_weight(robot), _CUT * robot_weight(robot))
            peak = max(impact.force for impact in impacts)
            axes[-1].set_title(f"{titles[-1]} (impacts up to {peak:.0f} N are cut off)")
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(first.time[0], first.time[-1])
        figure.align_ylabels(axes)
        legend_above(figure, axes[0], len(runs) + 1)
    return figure


def run_style(number: int, label: str, theme: Theme) -> dict[str, Any]:
    """Return the line of a run; from the third on wide and pale behind those that coincide."""
    behind = number >= 2
    return {
        "color": theme.series[number % len(theme.series)],
        "linestyle": "-" if behind else DASHES[number],
        "linewidth": 4.5 if behind else 1.4,
        "alpha": 0.4 if behind else 1.0,
        "zorder": 3.0 - 0.1 * number,
        "label": label,
    }


def _plot_run(
    axes: list[Axes], robot: Robot, log: Log, style: Mapping[str, Any], alone: bool
) -> None:
    position = configuration(robot, log)
    center = center_of_mass(robot, position)
    axes[0].plot(log.time, center[:, 2], **style)
    axes[1].plot(log.time, 1e3 * (center[:, 0] - _support(robot, log, position)), **style)
    axes[2].plot(log.time, np.degrees(base_pitch(robot, position)), **style)
    torque = rotor_torque(robot, log)
    hits = [int(np.searchsorted(log.time, impact.time)) for impact in log_impacts(robot, log)]
    for i in range(robot.transmission.size):
        plot_mean(axes[3 + i], log.time, torque[:, i], style, hits, samples=alone)
        limit = robot.transmission.torque_limit[i]
        if np.isfinite(limit) and np.nanmax(np.abs(torque[:, i])) > 0.5 * limit:
            for end in (-limit, limit):
                axes[3 + i].axhline(end, color="0.5", linewidth=0.8, linestyle=":")
    forces = contact_forces(robot, log)
    total = np.sum([force[:, 2] for force in forces.values()], axis=0) if forces else 0.0 * log.time
    plot_mean(axes[-1], log.time, total, style, hits, samples=alone)


def center_of_mass(robot: Robot, position: FloatArray) -> FloatArray:
    """Return the centre of mass (N, 3) [m], world."""
    data = robot.model.createData()
    return np.array([pin.centerOfMass(robot.model, data, q).copy() for q in position])


def base_pitch(robot: Robot, position: FloatArray) -> FloatArray:
    """Return the rotation (N,) [rad] about +y of the body that the last undriven joint carries."""
    if not robot.unactuated.size:
        return np.zeros(len(position))
    last = int(robot.unactuated[-1])
    number = next(
        j for j in range(robot.model.njoints - 1, 0, -1) if robot.model.joints[j].idx_v <= last
    )
    data = robot.model.createData()
    turns = np.empty((len(position), 3, 3))
    for row, q in enumerate(position):
        pin.forwardKinematics(robot.model, data, q)
        turns[row] = data.oMi[number].rotation
    return np.asarray(np.arctan2(turns[:, 0, 2], turns[:, 0, 0]))


def _support(robot: Robot, log: Log, position: FloatArray) -> float:
    """Return where x is counted from: the first contact at the end of the run, else 0."""
    if not robot.contacts:
        return 0.0
    contact = robot.contacts[0]
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, position[-1])
    frame = robot.model.getFrameId(contact.frame)
    return float(data.oMf[frame].act(contact.offset)[0])
