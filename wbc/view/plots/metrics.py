"""Inertia ellipsoids, force polytopes and the efficiency trade-off of the paper's case study."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError
from wbc.metrics import (
    Sweep,
    backward_generalized_inertia,
    efficiency_sweep,
    force_capability,
    forward_generalized_inertia,
    generalized_inertia,
)
from wbc.robot import Robot
from wbc.transmission import Direction
from wbc.view.impacts import robot_weight
from wbc.view.palette import LIGHT, Theme
from wbc.view.plots.style import DASHES, drawing, new_figure


def leg_figure(
    robot: Robot, position: ArrayLike, contact: str, theme: Theme = LIGHT, axes: str = "xz"
) -> Figure:
    """Return pose, inertia ellipsoids and force polytopes of one contact (Sim & Ramos, IV.D).

    The semi-axes of the ellipsoids are the principal inertias in kg, so that larger is heavier,
    as the paper draws them; the Forward-GIT is left out where it does not exist (floating base).

    Args:
        robot: with torque limits on every gear that the contact loads.
        position: q (nq,), not singular.
        contact: name of the contact point.
        theme: page colours.
        axes: two world axes, across and up.

    Raises:
        DynamicsError: a singular pose.
    """
    q = np.asarray(position, dtype=np.float64)
    with drawing(theme):
        figure, grid = new_figure(1, 3, 10.0, 3.7)
        pose, inertia, force = grid[0]
        _draw_pose(pose, robot, q, contact, axes, theme)
        _draw_inertia(inertia, robot, q, contact, axes, theme)
        _draw_force(force, robot, q, contact, axes, theme)
    return figure


def tradeoff_figure(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    direction: ArrayLike = (0.0, 1.0),
    theme: Theme = LIGHT,
    axes: str = "xz",
) -> Figure:
    """Return what less efficient gears cost and bring along one direction (Sim & Ramos, IV.D).

    Three panels over the forward efficiency of all gears: the wedge's backward efficiency; force
    that can be lifted and held over the force with perfect gears; impact mitigation factor.

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
    with drawing(theme):
        figure, grid = new_figure(1, 3, 10.0, 3.1)
        relation, capability, mitigation = grid[0]
        _draw_relation(relation, robot, eta, theme)
        _draw_ratios(capability, sweep, theme)
        mitigation.plot(eta, sweep.impact_mitigation, color=theme.series[2])
        mitigation.set_ylim(0.0, 1.0)
        mitigation.set_title("impact mitigation factor")
        mitigation.set_ylabel("IMF [-]")
        for ax in grid[0]:
            ax.set_xlabel("forward efficiency $\\eta_f$ [-]")
            ax.set_xlim(0.5, 1.0)
    return figure


def _draw_relation(ax: Axes, robot: Robot, eta: FloatArray, theme: Theme) -> None:
    gears = robot.transmission
    forward, backward = gears.forward_efficiency, gears.backward_efficiency
    ax.plot(eta, 2.0 - 1.0 / eta, color=theme.series[1])
    ax.plot(eta, eta, color=theme.faint, linestyle="--", linewidth=1.0)
    ax.scatter(forward, backward, color=theme.ink, zorder=3)
    for joint, f, b in zip(gears.joints, forward, backward, strict=True):
        ax.annotate(joint, (f, b), xytext=(5, -11), textcoords="offset points", fontsize=8)
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


def _draw_pose(
    ax: Axes, robot: Robot, q: FloatArray, contact: str, axes: str, theme: Theme
) -> None:
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    rows = ["xyz".index(axis) for axis in axes]
    point = robot.contact(contact)
    frame = model.getFrameId(point.frame)
    foot = np.asarray(data.oMf[frame].act(point.offset))[rows]
    joint = int(model.frames[frame].parentJoint)
    chain = [foot]
    while joint > 0:
        chain.append(np.asarray(data.oMi[joint].translation)[rows])
        joint = int(model.parents[joint])
    line = np.array(chain)
    ax.plot(line[:, 0], line[:, 1], color=theme.ink, linewidth=4, solid_capstyle="round", alpha=0.6)
    for name in robot.transmission.joints:
        place = np.asarray(data.oMi[model.getJointId(name)].translation)[rows]
        ax.plot(*place, "o", color=theme.series[0], markersize=9)
        ax.annotate(
            name, (place[0], place[1]), xytext=(9, 4), textcoords="offset points", fontsize=8
        )
    ax.plot(*foot, "o", color=theme.series[1], markersize=7)
    ax.annotate(contact, (foot[0], foot[1]), xytext=(9, 4), textcoords="offset points", fontsize=8)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.1, 0.1)
    ax.set_title("pose")
    ax.set_xlabel(f"{axes[0]} [m]")
    ax.set_ylabel(f"{axes[1]} [m]")


def _draw_inertia(
    ax: Axes, robot: Robot, q: FloatArray, contact: str, axes: str, theme: Theme
) -> None:
    tensors = {
        "GIT": generalized_inertia(robot, q, contact, axes),
        "Backward-GIT": backward_generalized_inertia(robot, q, contact, axes),
    }
    try:
        tensors["Forward-GIT"] = forward_generalized_inertia(robot, q, contact, axes)
    except DynamicsError:
        ax.annotate(
            "no Forward-GIT: the base is not driven",
            (0.03, 0.03),
            xycoords="axes fraction",
            fontsize=7.5,
        )
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    for i, (label, tensor) in enumerate(tensors.items()):
        values, vectors = np.linalg.eigh(0.5 * (tensor + tensor.T))
        curve = vectors @ (values[:, None] * circle)
        ax.plot(*curve, color=theme.series[i], linestyle=DASHES[i], label=label)
        tip = vectors[:, -1] * values[-1]
        ax.plot([0.0, tip[0]], [0.0, tip[1]], color=theme.series[i], linewidth=0.7)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.1, 0.1)
    ax.legend(loc="upper left")
    ax.set_title("inertia ellipsoids (principal inertias)")
    ax.set_xlabel(f"{axes[0]} [kg]")
    ax.set_ylabel(f"{axes[1]} [kg]")


def _draw_force(
    ax: Axes, robot: Robot, q: FloatArray, contact: str, axes: str, theme: Theme
) -> None:
    capability = force_capability(robot, q, contact, axes)
    names = {
        Direction.BACKWARD: "hold (backward)",
        Direction.STUCK: "perfect gears",
        Direction.FORWARD: "lift (forward)",
    }
    colours = {Direction.BACKWARD: 1, Direction.STUCK: 2, Direction.FORWARD: 0}
    for i, (mode, label) in enumerate(names.items()):
        try:
            corners = capability.vertices(mode)
        except DynamicsError:
            continue
        order = np.argsort(np.arctan2(*(corners - corners.mean(axis=0)).T[::-1]))
        colour = theme.series[colours[mode]]
        ax.add_patch(Polygon(corners[order], facecolor=colour, alpha=0.13))
        ax.add_patch(
            Polygon(corners[order], fill=False, edgecolor=colour, linestyle=DASHES[i], label=label)
        )
    if robot.floating_size:
        weight = robot_weight(robot)
        ax.axhline(weight, color=theme.ink, linewidth=0.9, linestyle=":")
        place = ("axes fraction", "data")
        ax.annotate("weight", (0.98, weight), xycoords=place, ha="right", va="bottom", fontsize=8)
    ax.autoscale_view()
    ax.margins(0.06, 0.2)
    ax.legend(loc="lower right")
    ax.set_title("force capability")
    ax.set_xlabel(f"$f_{axes[0]}$ [N]")
    ax.set_ylabel(f"$f_{axes[1]}$ [N]")
