"""Pose, inertia ellipsoids and force polytopes of the paper's case study."""

from __future__ import annotations

from textwrap import fill
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from wbc import metrics
from wbc.arrays import FloatArray
from wbc.errors import DynamicsError
from wbc.robot import Robot
from wbc.transmission import Direction
from wbc.view.palette import LIGHT, Theme
from wbc.view.shapes import robot_shapes
from wbc.view.style import DASHES, drawing, new_figure

# One colour for one assumption about the gears, in both panels.
_FORWARD, _BACKWARD, _PERFECT, _COMBINED = 0, 1, 2, 3
_DASH = {_BACKWARD: DASHES[0], _PERFECT: DASHES[1], _FORWARD: DASHES[2], _COMBINED: DASHES[3]}
_NEAR = 0.04  # of the panel: names of joints closer than that are written as one
_BELOW: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.16)}  # where no curve can reach it


def leg_figure(
    robot: Robot, position: ArrayLike, contact: str, theme: Theme = LIGHT, axes: str = "xz"
) -> Figure:
    """Return pose, inertia ellipsoids and force polytopes of one contact (Sim & Ramos, IV.D).

    The forces are those of the point on its surroundings. The combined polygon is that of
    `wbc.metrics.ForceCapability.moving`: the point is about to move along the second axis, as
    the foot of a leg whose body sinks. Where no motor limits the force its panel says why.

    The semi-axes of the ellipsoids are the principal inertias in kg, so that larger is heavier,
    as the paper draws them; the Forward-GIT is left out where it does not exist (floating base).

    Args:
        robot: whose gears and links are drawn.
        position: q (nq,), not singular.
        contact: name of the contact point.
        theme: page colours.
        axes: two world axes, across and up.

    Raises:
        DynamicsError: a singular pose.
    """
    q = np.asarray(position, dtype=np.float64)
    with drawing(theme):
        figure, grid = new_figure(1, 3, 10.0, 4.3)
        for ax, draw in zip(grid[0], (_draw_pose, _draw_inertia, _draw_force), strict=True):
            draw(ax, robot, q, contact, axes, theme)
    return figure


def _draw_pose(
    ax: Axes, robot: Robot, q: FloatArray, contact: str, axes: str, theme: Theme
) -> None:
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    rows = ["xyz".index(axis) for axis in axes]
    point = robot.contact(contact)
    frame = model.getFrameId(point.frame)
    foot = np.asarray(data.oMf[frame].act(point.offset))[rows]
    joint, driven = int(model.frames[frame].parentJoint), set(robot.transmission.joints)
    chain, names = [foot], [contact]
    while model.names[joint] in driven:
        chain.append(np.asarray(data.oMi[joint].translation)[rows])
        names.append(model.names[joint])
        joint = int(model.parents[joint])
    carried = [shape.corners for shape in robot_shapes(robot) if shape.joint == joint]
    corners = np.array([data.oMi[joint].act(one)[rows] for own in carried for one in own])
    if len(corners) and np.ptp(corners, axis=0).min() > 1e-9:  # the body that carries the limb
        outline = corners[ConvexHull(corners).vertices]
        ax.add_patch(Polygon(outline, facecolor=theme.faint, edgecolor=theme.ink, alpha=0.4))
    line = np.array(chain)
    ax.plot(line[:, 0], line[:, 1], color=theme.ink, linewidth=4, solid_capstyle="round", alpha=0.6)
    for name in driven - set(names):  # of other limbs: in their place, without a name
        place = np.asarray(data.oMi[model.getJointId(name)].translation)[rows]
        ax.plot(*place, "o", color=theme.faint, markersize=6, zorder=1)
    ax.plot(*line[1:].T, "o", color=theme.series[0], markersize=9)
    ax.plot(*foot, "o", color=theme.series[1], markersize=7)
    _name_places(ax, names, line)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12, 0.06)
    ax.set(title="pose", xlabel=f"{axes[0]} [m]", ylabel=f"{axes[1]} [m]")


def _name_places(ax: Axes, names: list[str], places: FloatArray) -> None:
    """Write names (k,) beside places (k, 2), a line each for those that lie on each other."""
    near = _NEAR * max(float(np.ptp(places, axis=0).max()), 1e-9)
    told: dict[tuple[float, float], str] = {}
    for name, (x, y) in zip(names, places.tolist(), strict=True):
        place = next((one for one in told if np.hypot(x - one[0], y - one[1]) <= near), (x, y))
        told[place] = f"{told[place]}\n{name}" if place in told else name
    for place, text in told.items():
        ax.annotate(text, place, xytext=(9, 4), textcoords="offset points", fontsize=8)


def _draw_inertia(
    ax: Axes, robot: Robot, q: FloatArray, contact: str, axes: str, theme: Theme
) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    circle = np.stack([np.cos(angle), np.sin(angle)])

    def draw(colour: int, label: str, tensor: FloatArray) -> None:
        values, vectors = np.linalg.eigh(0.5 * (tensor + tensor.T))
        curve = vectors @ (values[:, None] * circle)
        ax.plot(*curve, label=label, color=theme.series[colour], linestyle=_DASH[colour])
        tip = vectors[:, -1] * values[-1]
        ax.plot([0.0, tip[0]], [0.0, tip[1]], color=theme.series[colour], linewidth=0.7)

    draw(_PERFECT, "GIT (perfect gears)", metrics.generalized_inertia(robot, q, contact, axes))
    draw(_BACKWARD, "Backward-GIT", metrics.backward_generalized_inertia(robot, q, contact, axes))
    try:
        draw(_FORWARD, "Forward-GIT", metrics.forward_generalized_inertia(robot, q, contact, axes))
    except DynamicsError:
        ax.plot([], [], " ", label="no Forward-GIT: the base is not driven")
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.1, 0.1)
    ax.legend(**_BELOW)
    ax.set_title("inertia ellipsoids (principal inertias)")
    ax.set(xlabel=f"{axes[0]} [kg]", ylabel=f"{axes[1]} [kg]")


def _draw_force(
    ax: Axes, robot: Robot, q: FloatArray, contact: str, axes: str, theme: Theme
) -> None:
    capability = metrics.force_capability(robot, q, contact, axes)
    polygons = (
        ("hold (backward)", _BACKWARD, Direction.BACKWARD),
        ("perfect gears", _PERFECT, Direction.STUCK),
        ("lift (forward)", _FORWARD, Direction.FORWARD),
        (f"combined, about to move along {axes[1]}", _COMBINED, None),
    )
    reason = ""
    for label, number, way in polygons:
        try:
            corners = capability.moving((0.0, 1.0)) if way is None else capability.vertices(way)
        except DynamicsError as cause:
            reason = str(cause)
            continue
        colour = theme.series[number]
        look: Any = {"label": label, "linestyle": _DASH[number], "linewidth": 1.4}
        look |= {"facecolor": to_rgba(colour, 0.13), "edgecolor": colour}
        ax.add_patch(Polygon(corners, **look))
    ax.set_title("force on the surroundings")
    if not ax.patches:
        text = fill(reason, 36)
        ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", fontsize=8)
        ax.set_axis_off()
        return
    if robot.floating_size:
        weight = -robot.weight  # what a foot that carries all presses on the ground with
        ax.axhline(weight, color=theme.ink, linewidth=0.9, linestyle=":")
        place = ("axes fraction", "data")
        ax.annotate("weight", (1.01, weight), xycoords=place, va="center", fontsize=8)
    ax.autoscale_view()
    ax.margins(0.06, 0.08)
    ax.legend(**_BELOW)
    ax.set(xlabel=f"$f_{axes[0]}$ [N]", ylabel=f"$f_{axes[1]}$ [N]")
