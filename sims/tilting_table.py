"""A brick on a table that tilts to and fro: ground that moves, and where friction gives way.

Run: python -m sims.tilting_table
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from wbc import Robot
from wbc.arrays import FloatArray
from wbc.robot import ContactPoint
from wbc.sim import Moving, Plane, Plant
from wbc.transmission import Transmission
from wbc.view import LIGHT, Theme
from wbc.view.plots import drawing, new_figure, write_figure

OUT = Path("out")
TILT, RATE, FRICTION = np.radians(20.0), np.pi, 0.25  # [rad], [rad/s] of the swing
HALF = np.array([0.15, 0.1, 0.05])  # [m]
STEP, SECONDS = 2e-3, 2.0


def angle(time: float) -> float:
    """Return the tilt [rad] of the table; it starts level and at rest."""
    return float(0.5 * TILT * (1.0 - np.cos(RATE * time)))


def pose(time: float) -> pin.SE3:
    """Return the placement of the table, tilted about the world's y axis."""
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, angle(time), 0.0), np.zeros(3))


def brick() -> Robot:
    """Return a body with four contact points below it."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "brick")
    inertia = pin.Inertia.FromBox(1.0, *(2.0 * HALF))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addBodyFrame("body", joint, pin.SE3.Identity(), 0)
    corners = [HALF * np.array([x, y, -1.0]) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    points = [
        ContactPoint(f"corner_{k}", "body", at, friction=FRICTION) for k, at in enumerate(corners)
    ]
    return Robot("brick", model, Transmission((), np.zeros(0), np.zeros(0)), tuple(points))


def main() -> FloatArray:
    """Return rows (N, 4): time [s], tilt [rad], the brick along and above the table [m]."""
    robot = brick()
    plant, q, rows = Plant(robot, Moving(Plane(), pose)), robot.neutral(), []
    q[2] = HALF[2]
    state = plant.state(q)
    while state.time < SECONDS:
        place = pose(state.time).actInv(state.position[:3])
        rows.append((state.time, angle(state.time), place[0], place[2]))
        state = plant.step(state, [], STEP).state
    return np.array(rows)


def figure(rows: FloatArray, theme: Theme = LIGHT) -> Figure:
    """Draw the brick on its table at four instants, and how far it has slid over time."""
    time, tilt, along, _ = rows.T
    colour = theme.series
    with drawing(theme):
        found, ((left, right),) = new_figure(1, 2, 9.5, 3.8)
        for number, instant in enumerate((0.0, 0.75, 1.5)):
            k = int(np.argmin(np.abs(time - instant)))
            sine, cosine = np.sin(tilt[k]), np.cos(tilt[k])
            turn = np.array([[cosine, -sine], [sine, cosine]])  # x, z of the table to the world's
            table = np.array([[-0.3, 0.0], [1.0, 0.0]]) @ turn
            left.plot(*table.T, color=colour[number])
            sides = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * HALF[[0, 2]]
            shape = (sides + rows[k, 2:]) @ turn
            left.add_patch(Polygon(shape, fill=False, edgecolor=colour[number]))
            left.plot([], [], color=colour[number], label=f"{time[k]:.2f} s")
        left.set(aspect="equal", title="a brick on a table", xlabel="x [m]", ylabel="z [m]")
        right.plot(time, along, color=colour[0], label="slid along the table [m]")
        right.plot(time, np.tan(tilt), "--", color=colour[1], label="tan of the tilt")
        right.axhline(FRICTION, linestyle=":", color=theme.ink, label="friction coefficient")
        right.set(title="it slides while the table is too steep", xlabel="time [s]")
        left.legend()
        right.legend()
    return found


if __name__ == "__main__":
    rows = main()
    slid = rows[np.argmax(rows[:, 2] > 1e-4)]
    print(f"slides from {slid[0]:.3f} s on, at tan(tilt) = {np.tan(slid[1]):.3f}")
    print(f"slid {rows[-1, 2]:.3f} m")
    write_figure(OUT / "tilting_table.png", figure(rows))
