"""Bodies on edges, on each other and between fingers: where they lie once they rest.

Run: python -m sims.bodies
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from wbc import Robot
from wbc.arrays import FloatArray
from wbc.robot import BodySurface, FreeBody, LinkSolid, bare_robot, body_surfaces
from wbc.sim import Plant, SimState, Stairs
from wbc.view import LIGHT, Theme
from wbc.view.plots import drawing, new_figure, write_figure

OUT = Path("out")
STEP = 1e-3  # [s]
GRIP, LIFT = 8.0, 0.1  # [N] of each finger, [m/s] of the hand
_STAIR = Stairs(edges=np.array([0.0]), heights=np.array([0.0, 0.1]))


@dataclass(frozen=True)
class Scene:
    """Bodies and how they begin.

    Attributes:
        title: of the picture.
        plant: bodies and ground.
        start: q (nq,).
        duration: [s].
        fingers: whether the first joints are a hand that rises and two fingers that press.
    """

    title: str
    plant: Plant
    start: FloatArray
    duration: float
    fingers: bool = False


def placed(*places: tuple[list[float], list[float]]) -> FloatArray:
    """Return q of free bodies at places [m], turned by roll, pitch, yaw [rad]."""
    turns = [pin.Quaternion(pin.rpy.rpyToMatrix(*turn)).coeffs() for _, turn in places]
    return np.concatenate([np.r_[at, turn] for (at, _), turn in zip(places, turns, strict=True)])


def hand(mass: float = 0.5) -> Robot:
    """Return a hand that slides up, two fingers along x, and a box of `mass` [kg] between them."""
    model, side = pin.Model(), np.array([0.02, 0.04, 0.06])
    joints = [model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "hand")]
    for name in ("left", "right"):
        joints.append(model.addJoint(1, pin.JointModelPX(), pin.SE3.Identity(), name))
    for number, own_mass in zip(joints, (1.0, 0.2, 0.2), strict=True):
        own = pin.Inertia.FromBox(own_mass, *side)
        model.appendBodyToJoint(number, own, pin.SE3.Identity())
        model.addBodyFrame(f"{model.names[number]}_link", number, pin.SE3.Identity(), 0)
    fingers = tuple(LinkSolid(f"{name}_link", coal.Box(*side)) for name in ("left", "right"))
    robot = replace(bare_robot(model), surface=BodySurface(solids=fingers, friction=0.8))
    box = FreeBody("box", coal.Box(0.08, 0.08, 0.08), mass)
    pairs = [("left_link", "box"), ("right_link", "box")]
    return robot.with_free_bodies(box, pairs=pairs)


def scenes() -> tuple[Scene, ...]:
    """Return a plank on the edge of a stair, a stack of two boxes, and a box between fingers."""
    none = bare_robot(pin.Model())
    plank = none.with_free_bodies(FreeBody("plank", coal.Box(0.6, 0.4, 0.1), 2.0))
    boxes = [FreeBody(name, coal.Box(0.2, 0.2, 0.2), 1.0) for name in ("lower", "upper")]
    stack = none.with_free_bodies(*boxes, pairs=[("lower", "upper")])
    return (
        Scene("a plank on the edge of a stair", Plant(plank, _STAIR),
              placed(([-0.05, 0.0, 0.35], [0.0, 0.3, 0.0])), 1.0),
        Scene("a stack of two boxes", Plant(stack),
              placed(([0.0, 0.0, 0.11], [0.0] * 3), ([0.03, 0.02, 0.35], [0.1, 0.05, 0.4])), 1.0),
        Scene("a box lifted by two fingers", Plant(hand()),
              np.concatenate(([0.07, -0.08, 0.08], placed(([0.0, 0.0, 0.04], [0.0] * 3)))), 1.0,
              fingers=True),
    )  # fmt: skip


def run(scene: Scene) -> list[SimState]:
    """Return the states of a scene, step by step."""
    plant = scene.plant
    model, states = plant.robot.model, [plant.state(scene.start)]
    push = np.zeros(model.nv)
    for _ in range(round(scene.duration / STEP)):
        if scene.fingers:
            state = states[-1]
            # The hand waits until the fingers hold the box, then rises.
            wanted = 0.07 + LIFT * max(state.time - 0.3, 0.0)
            push[0] = 9.81 * 2.0 + 2000.0 * (wanted - state.position[0]) - 100.0 * state.velocity[0]
            push[1:3] = GRIP, -GRIP
        states.append(plant.step(states[-1], [], STEP, external=push).state)
    return states


def main() -> list[tuple[Scene, list[SimState]]]:
    """Return all scenes with their states."""
    return [(scene, run(scene)) for scene in scenes()]


def outlines(robot: Robot, position: FloatArray) -> Iterator[FloatArray]:
    """Yield the outlines (n, 2) of a robot's solids as they are seen along y."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, position)
    for hull in body_surfaces(robot)[1]:
        pose = data.oMi[hull.joint]
        points = (hull.corners @ pose.rotation.T + pose.translation)[:, [0, 2]]
        yield points[ConvexHull(points).vertices]


def draw(axes: Axes, scene: Scene, states: list[SimState], theme: Theme) -> None:
    """Draw the start of a scene with thin lines, and its end filled."""
    for state, filled in ((states[0], False), (states[-1], True)):
        for number, outline in enumerate(outlines(scene.plant.robot, state.position)):
            colour = theme.series[number]
            axes.fill(*outline.T, facecolor=colour if filled else "none", edgecolor=colour,
                      alpha=0.8 if filled else 0.5, linestyle="-" if filled else ":")  # fmt: skip
    stair = isinstance(scene.plant.terrain, Stairs)
    ground = [[-0.4, 0.0], [0.0, 0.0], [0.0, 0.1], [0.5, 0.1]] if stair else [[-0.3, 0], [0.3, 0]]
    axes.plot(*np.transpose(ground), color=theme.ink)
    axes.set(aspect="equal", title=scene.title, xlabel="x [m]", ylabel="z [m]")


def figure(results: list[tuple[Scene, list[SimState]]], theme: Theme = LIGHT) -> Figure:
    """Draw where the bodies begin and where they end."""
    with drawing(theme):
        found, (row,) = new_figure(1, len(results), 11.0, 3.6)
        for axes, (scene, states) in zip(row, results, strict=True):
            draw(axes, scene, states, theme)
    return found


if __name__ == "__main__":
    done = main()
    for scene, states in done:
        plant, end = scene.plant, states[-1]
        gaps = np.concatenate((plant.gaps(end), plant.pair_gaps(end)))
        print(
            f"{scene.title}: fastest {np.abs(end.velocity).max():.1e}, "
            f"deepest {-1e3 * min(gaps.min(), 0.0):.1e} mm"
        )
    write_figure(OUT / "bodies.png", figure(done))
