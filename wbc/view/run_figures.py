"""Power, losses and energy of a run, its impacts, and how it stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.integrate import cumulative_trapezoid

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque
from wbc.identification.records.channels import contact_forces
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view import channels, style
from wbc.view.palette import DIRECTION_COLOURS, DIRECTION_LABELS, LIGHT, Theme

_SHOWN = 1.0 / 150.0  # of its span, over which a plot can average without hiding anything
_ROUGH = 0.1
_CUT = 4.0  # weights at which the axis of the force ends where something lands


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
    flow = channels.gear_flow(robot, log, _SHOWN * log.duration)
    impacts, sky, red = channels.log_impacts(robot, log), theme.series[5], theme.series[1]
    with style.drawing(theme):
        figure, grid = style.new_figure(gears.size, 2, 9.0, 2.1 * gears.size + 0.6, share_x=True)
        for i, joint in enumerate(gears.joints):
            (power, loss), entering, lost = grid[i], flow.mesh_power[:, i], flow.loss[:, i]
            for mode, colour in DIRECTION_COLOURS.items():
                inside, label = flow.direction[:, i] == mode, DIRECTION_LABELS[mode]
                look: Any = {"color": colour, "label": label, "alpha": 0.75, "linewidth": 0.0}
                power.fill_between(log.time, entering, where=inside, step="mid", **look)
            power.plot(log.time, entering, color=theme.ink, linewidth=0.5)
            power.set_title(f"{joint}: power into the teeth")
            loss.fill_between(log.time, lost, color=sky, alpha=0.5, linewidth=0.0)
            loss.plot(log.time, lost, color=sky, linewidth=0.9)
            total = loss.twinx()
            total.plot(log.time, cumulative_trapezoid(lost, log.time, initial=0.0), color=red)
            total.set_ylabel("heat so far [J]", color=red)
            total.tick_params(axis="y", colors=red)
            total.grid(visible=False)
            total.set_ylim(bottom=0.0)
            loss.set_ylim(bottom=0.0)
            forward, backward = gears.forward_efficiency[i], gears.backward_efficiency[i]
            shares = f"$\\eta_f$ = {forward:.2f}, $\\eta_b$ = {backward:.2f}"
            loss.set_title(f"{joint}: loss ({shares})")
            for ax in (power, loss):
                ax.set(ylabel="power [W]", xlim=(log.time[0], log.time[-1]))
                _mark_impacts(ax, impacts, theme.ink)
        for ax in grid[-1]:
            ax.set_xlabel("time [s]")
        style.legend_above(figure, grid[0][0], 3)
    return figure


def energy_audit(robot: Robot, log: Log) -> dict[str, FloatArray]:
    """Return where the energy of a recording went according to the model, (N,) [J] from its start.

    In and stored: `work of the motors`; `work of the ground` on the robot (0 where nothing slides
    and nothing hits; negative for an impact that swallows energy); the change of `kinetic energy`,
    with the rotors', and `potential energy`; `heat in gears`, teeth and rotor friction. What the
    model lacks (friction, a payload, an impact too short for the sampling) is `unexplained`.

    Args:
        robot: whose masses and gears.
        log: positions or velocities; torques and contact forces that are held from each row to the
            next, as in a recording of the simulator.
    """
    position, speed = channels.configuration(robot, log), channels.velocity(robot, log)
    model, data, gears = robot.model, robot.model.createData(), robot.transmission
    states = zip(position, speed, strict=True)
    links = np.array([pin.computeKineticEnergy(model, data, q, v) for q, v in states])
    height = np.array([pin.computePotentialEnergy(model, data, q) for q in position])
    output = speed[:, robot.actuated] @ gears.motor_from_joint.T
    kinetic = links + 0.5 * np.sum(gears.reflected_inertia * output**2, axis=1)
    # The torque of a row is held to the next, while the speed changes between the two. Powers that
    # are sampled at the rows miss how a controller answers to noise: over two squats of the leg
    # they leave 0.12 J of 18 J unexplained, these 0.008 J, as the simulator's own balance does.
    torque, middle = channels.rotor_torque(robot, log)[:-1], 0.5 * (output[1:] + output[:-1])
    steps = np.diff(log.time)
    drive, growth = torque * gears.gear_ratio * middle, np.diff(output, axis=0) / steps[:, None]
    _, loss = channels.gear_powers(gears, torque, middle, growth)
    force = contact_torque(robot, position, contact_forces(robot, log))
    push = force[:-1] * 0.5 * (speed[1:] + speed[:-1])
    powers = (np.nansum(power, axis=1) for power in (drive, push, loss))
    motor, ground, heat = (np.append(0.0, np.cumsum(power * steps)) for power in powers)
    kinetic, potential = kinetic - kinetic[0], height - height[0]
    return {
        "work of the motors": motor,
        "work of the ground": ground,
        "kinetic energy": kinetic,
        "potential energy": potential,
        "heat in gears": heat,
        "unexplained": motor + ground - kinetic - potential - heat,
    }


def energy_figure(robot: Robot, log: Log, theme: Theme = LIGHT) -> Figure:
    """Return the audit as lines: what came in, what is stored, what is lost.

    Args:
        robot, log: see `energy_audit`.
        theme: page colours.
    """
    lines = energy_audit(robot, log)
    unexplained = lines.pop("unexplained")
    largest = max(float(np.abs(values).max()) for values in lines.values())
    left = float(np.abs(unexplained).max())
    with style.drawing(theme):
        figure, ((upper,), (lower,)) = style.new_figure(2, 1, 7.0, 4.6, share_x=True)
        grid: Any = upper.get_gridspec()
        grid.set_height_ratios([3, 1])
        for i, (label, values) in enumerate(lines.items()):
            look: Any = {"color": theme.series[i], "linestyle": style.DASHES[i], "label": label}
            upper.plot(log.time, values, **look)
        upper.set(title="energy since the start", ylabel="energy [J]")
        style.legend_above(figure, upper, 3)
        lower.plot(log.time, unexplained, color=theme.ink)
        # On the scale of a twentieth of the energies: a line that looks flat is explained.
        lower.set_ylim(-(limit := max(0.05 * largest, 1.2 * left)), limit)
        share = 100.0 * left / largest if largest else 0.0
        lower.set_title(f"not explained: at most {left:.2g} J, {share:.1g} % of the largest energy")
        lower.set(ylabel="energy [J]", xlabel="time [s]", xlim=(log.time[0], log.time[-1]))
        figure.align_ylabels([upper, lower])
    return figure


def standing_figure(robot: Robot, runs: Mapping[str, Log], theme: Theme = LIGHT) -> Figure:
    """Return height, sway and pitch of the centre of mass and base, rotor torques and ground force.

    Torque and force that noise shakes are shown as their mean, of a single run in front of every
    sample. Where something lands the axis of the force ends at four weights.

    Args:
        robot: the robot of all runs (its links; the gears may differ from run to run).
        runs: label -> recording.
        theme: page colours.
    """
    limits = robot.transmission.torque_limit
    impacts = {label: channels.log_impacts(robot, log) for label, log in runs.items()}
    with style.drawing(theme):
        rows = 4 + robot.transmission.size
        figure, grid = style.new_figure(rows, 1, 7.0, 1.25 * rows + 0.6, share_x=True)
        axes = [row[0] for row in grid]
        for i, (label, log) in enumerate(runs.items()):
            hits = [int(np.searchsorted(log.time, impact.time)) for impact in impacts[label]]
            signals, look = _standing_signals(robot, log), run_style(i, label, theme)
            for ax, (title, (unit, values)) in zip(axes, signals.items(), strict=True):
                ax.set(title=title, ylabel=unit)
                shown = _mean_if_rough(values, hits) if "N" in unit else values
                if shown is not values and len(runs) == 1:  # samples of several hide one another
                    samples: Any = {"linewidth": 0.5, "alpha": 0.25, "zorder": 1.5}
                    ax.plot(log.time, values, color=look["color"], **samples)
                ax.plot(log.time, shown, **look)
            for ax, limit in zip(axes[3:-1], limits, strict=True):
                if np.isfinite(limit) and np.abs(ax.dataLim.intervaly).max() > 0.5 * limit:
                    for end in (-limit, limit):
                        ax.axhline(end, color="0.5", linewidth=0.8, linestyle=":")
        first = next(iter(runs.values()))
        for ax in axes:
            _mark_impacts(ax, next(iter(impacts.values())), theme.ink)
        if peaks := [impact.force for found in impacts.values() for impact in found]:
            # The force of an impact would flatten all others.
            axes[-1].set_ylim(-0.1 * robot.weight, _CUT * robot.weight)
            title = f"vertical ground force (impacts up to {max(peaks):.0f} N are cut off)"
            axes[-1].set_title(title)
        axes[-1].set(xlabel="time [s]", xlim=(first.time[0], first.time[-1]))
        figure.align_ylabels(axes)
        style.legend_above(figure, axes[0], len(runs))
    return figure


def _standing_signals(robot: Robot, log: Log) -> dict[str, tuple[str, FloatArray]]:
    """Return title -> label of the axis and values (N,); sway from the first contact at its end."""
    poses, center, points = channels.kinematics(robot, channels.configuration(robot, log))
    start = points[-1, 0, 0] if robot.contacts else 0.0
    torque = channels.rotor_torque(robot, log)
    vertical = (force[:, 2] for force in contact_forces(robot, log).values())
    return {
        "height of the centre of mass": ("height [m]", center[:, 2]),
        "sway of the centre of mass": ("sway [mm]", 1e3 * (center[:, 0] - start)),
        "pitch of the base": ("pitch [deg]", np.degrees(channels.base_pitch(robot, poses))),
        **{
            f"rotor torque, {joint}": ("torque [N m]", torque[:, k])
            for k, joint in enumerate(robot.transmission.joints)
        },
        "vertical ground force": ("force [N]", sum(vertical, np.zeros(len(log)))),
    }


def run_style(number: int, label: str, theme: Theme) -> dict[str, Any]:
    """Return the line of a run; from the third on wide and pale behind those that coincide."""
    behind = number >= 2
    return {
        "color": theme.series[number % len(theme.series)],
        "linestyle": "-" if behind else style.DASHES[number],
        "linewidth": 4.5 if behind else 1.4,
        "alpha": 0.4 if behind else 1.0,
        "zorder": 3.0 - 0.1 * number,
        "label": label,
    }


def _mark_impacts(axes: Axes, impacts: Sequence[channels.RecordedImpact], colour: str) -> None:
    """Draw a thin line at every impact."""
    for impact in impacts:
        axes.axvline(impact.time, color=colour, linewidth=0.8, linestyle=(0, (2, 2)))


def _mean_if_rough(values: FloatArray, jumps: Sequence[int]) -> FloatArray:
    """Return the mean of a signal (N,) where it is rough, never across a jump, else the signal."""
    mean = channels.window_mean(values, round(len(values) * _SHOWN), jumps)
    rough = float(np.nanstd(values - mean)) > _ROUGH * float(np.nanstd(values))
    return mean if rough else values
