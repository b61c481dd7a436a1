"""Boxes on a ramp, on each other and on an edge: this library, MuJoCo and Drake side by side.

    python -m benchmarks.bodies [--steps 3000] [--quadruped]

The same boxes with the same friction, steps of 1 ms, each simulator with its own contact at its
defaults (MuJoCo with elliptic cones). Creep is how far the first box moves in the last second;
depth how far corners lie inside the ground or the other box in that second, at most; made is the
most that the energy rises in a step, as a share of the start's; fastest is the highest speed at the
end. Drake is no dependency of this project: `pip install drake` adds its rows.

`--quadruped` times Solo12 instead: on four feet, on twenty points, with all its links, and lying on
a plane and on height fields.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import pairwise, product
from time import perf_counter, process_time

import coal
import mujoco
import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from wbc import Robot, load_robot
from wbc.robot import FreeBody, bare_robot
from wbc.sim import Box, HeightField, Plane, Plant, Together

STEP, FRICTION, GRAVITY = 1e-3, 0.7, 9.81
CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))


@dataclass(frozen=True)
class Solid:
    """A box: whole sides [m], mass [kg] (0 for ground), place, and roll, pitch, yaw."""

    sides: tuple[float, float, float]
    mass: float
    place: tuple[float, float, float]
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def pose(self) -> pin.SE3:
        """Its placement at the start."""
        return pin.SE3(pin.rpy.rpyToMatrix(*self.turn), np.array(self.place))


_RAMP = np.radians(20.0)
_BED = Solid((20.0, 20.0, 1.0), 0.0, (0.0, 0.0, -0.5))
_TILTED = Solid(_BED.sides, 0.0, (0.5 * np.sin(_RAMP), 0.0, -0.5 * np.cos(_RAMP)), (0, -_RAMP, 0))
SCENES = {
    "ramp of 20 degrees": (
        _TILTED,
        Solid((0.4, 0.4, 0.2), 2.0, (-0.101 * np.sin(_RAMP), 0, 0.101 * np.cos(_RAMP)),
              (0, -_RAMP, 0)),
    ),
    "stack": (
        _BED,
        Solid((0.2, 0.2, 0.2), 1.0, (0, 0, 0.101)),
        Solid((0.2, 0.2, 0.2), 1.0, (0.03, 0.02, 0.32), (0.05, 0.02, 0.4)),
    ),
    "plank on an edge": (
        _BED,
        Solid((1.0, 2.0, 0.3), 0.0, (0.5, 0, -0.05)),
        Solid((0.6, 0.4, 0.1), 2.0, (-0.05, 0, 0.3), (0, 0.2, 0)),
    ),
}  # fmt: skip
Frames = np.ndarray
"""(n, b, 13): place, quaternion (x, y, z, w), velocity and angular velocity of boxes, world."""
Run = Callable[[tuple[Solid, ...], int], tuple[Frames, float]]


def wbc(solids: tuple[Solid, ...], steps: int) -> tuple[Frames, float]:
    """Run this library; return frames and seconds per step."""
    still, loose = [s for s in solids if not s.mass], [s for s in solids if s.mass]
    ground = [Box(np.array(s.place), np.array(s.sides), s.pose.rotation) for s in still]
    names = [f"box_{i}" for i in range(len(loose))]
    bodies = [FreeBody(n, coal.Box(*s.sides), s.mass) for n, s in zip(names, loose, strict=True)]
    robot = bare_robot(pin.Model()).with_free_bodies(*bodies, pairs=list(pairwise(names)))
    plant = Plant(robot, Together([Plane(height=-5.0), *ground]))
    q = np.concatenate([pin.SE3ToXYZQUAT(s.pose) for s in loose])
    state = plant.state(q)

    def step(_: int) -> None:
        nonlocal state
        state = plant.step(state, [], STEP).state

    def boxes() -> Iterator[np.ndarray]:
        for q, v in zip(state.position.reshape(-1, 7), state.velocity.reshape(-1, 6), strict=True):
            turn = pin.Quaternion(q[3:]).matrix()
            yield np.concatenate((q, turn @ v[:3], turn @ v[3:]))

    return seen(step, boxes, steps)


def seen(
    step: Callable[[int], None], boxes: Callable[[], Iterable[np.ndarray]], steps: int
) -> tuple[Frames, float]:
    """Return what the boxes (13,) do in so many steps, and the seconds of a step alone."""
    frames, spent = [], 0.0
    for k in range(steps):
        began = process_time()
        step(k)
        spent += process_time() - began
        frames.append(list(boxes()))
    return np.array(frames), spent / steps


def scene_file(solids: tuple[Solid, ...]) -> str:
    """Return the boxes as MJCF."""
    text = ""
    for solid in solids:
        quat = pin.SE3ToXYZQUAT(solid.pose)[[6, 3, 4, 5]]
        size, place = (" ".join(map(str, v)) for v in (np.divide(solid.sides, 2), solid.place))
        at = f'pos="{place}" quat="{" ".join(map(str, quat))}"'
        geom = f'<geom type="box" size="{size}" friction="{FRICTION} 0 0" '
        loose = f'<body {at}><freejoint/>{geom} mass="{solid.mass}"/></body>'
        text += loose if solid.mass else f"{geom} {at}/>"
    return (
        f'<mujoco><option timestep="{STEP}" cone="elliptic" gravity="0 0 -{GRAVITY}"/>'
        f"<worldbody>{text}</worldbody></mujoco>"
    )


def mujoco_run(solids: tuple[Solid, ...], steps: int) -> tuple[Frames, float]:
    """Run MuJoCo."""
    model = mujoco.MjModel.from_xml_string(scene_file(solids))
    data = mujoco.MjData(model)

    def boxes() -> Iterator[np.ndarray]:
        for q, v in zip(data.qpos.reshape(-1, 7), data.qvel.reshape(-1, 6), strict=True):
            turn = pin.Quaternion(q[[4, 5, 6, 3]]).matrix()
            yield np.concatenate((q[:3], q[[4, 5, 6, 3]], v[:3], turn @ v[3:]))

    return seen(lambda _: mujoco.mj_step(model, data), boxes, steps)


def drake_run(solids: tuple[Solid, ...], steps: int) -> tuple[Frames, float]:
    """Run Drake's discrete plant (point contact)."""
    from pydrake.geometry import AddContactMaterial, Box as DrakeBox, ProximityProperties
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
    from pydrake.multibody.tree import SpatialInertia, UnitInertia
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=STEP)
    law = ProximityProperties()
    AddContactMaterial(friction=CoulombFriction(FRICTION, FRICTION), properties=law)
    loose = []
    for i, solid in enumerate(solids):
        body, place = plant.world_body(), RigidTransform(solid.pose.homogeneous)
        if solid.mass:
            inertia = SpatialInertia(solid.mass, np.zeros(3), UnitInertia.SolidBox(*solid.sides))
            body, place = plant.AddRigidBody(f"box_{i}", inertia), RigidTransform()
            loose.append((body, solid))
        plant.RegisterCollisionGeometry(body, place, DrakeBox(*solid.sides), f"solid_{i}", law)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for body, solid in loose:
        plant.SetFreeBodyPose(context, body, RigidTransform(solid.pose.homogeneous))

    def boxes() -> Iterator[np.ndarray]:
        for body, _ in loose:
            pose = plant.EvalBodyPoseInWorld(context, body)
            speed = plant.EvalBodySpatialVelocityInWorld(context, body)
            quat = pose.rotation().ToQuaternion().wxyz()[[1, 2, 3, 0]]
            parts = pose.translation(), quat, speed.translational(), speed.rotational()
            yield np.concatenate(parts)

    return seen(lambda k: simulator.AdvanceTo((k + 1) * STEP), boxes, steps)


def inside(solids: tuple[Solid, ...], frame: np.ndarray) -> float:
    """Return how deep boxes lie in each other in a frame (b, 13) [m], by separating axes."""
    loose = iter(frame)
    poses = [pin.XYZQUATToSE3(next(loose)[:7]) if solid.mass else solid.pose for solid in solids]
    deepest = 0.0
    for j, other in enumerate(solids):
        for i in range(j):
            if not (other.mass or solids[i].mass):
                continue
            turns = [poses[k].rotation.T for k in (i, j)]
            crossed = [np.cross(a, b) for a, b in product(*turns)]
            axes = np.array([*turns[0], *turns[1], *crossed])
            size = np.linalg.norm(axes, axis=1)
            axes = axes[size > 1e-6] / size[size > 1e-6, None]
            seen = [
                (CORNERS * solids[k].sides) @ poses[k].rotation.T @ axes.T
                + poses[k].translation @ axes.T
                for k in (i, j)
            ]
            one, two = seen
            apart = np.maximum(two.min(axis=0) - one.max(axis=0), one.min(axis=0) - two.max(axis=0))
            deepest = max(deepest, -float(apart.max()))
    return deepest


def energies(solids: tuple[Solid, ...], frames: Frames) -> np.ndarray:
    """Return the mechanical energy (n,) of the boxes [J]."""
    total = np.zeros(len(frames))
    for i, solid in enumerate(s for s in solids if s.mass):
        own = frames[:, i]
        squares = np.square(solid.sides)
        turning = solid.mass / 12.0 * (squares.sum() - squares)
        turns = np.array([pin.Quaternion(q).matrix() for q in own[:, 3:7]])
        spin = np.einsum("nij,ni->nj", turns, own[:, 10:])
        total += solid.mass * (GRAVITY * own[:, 2] + 0.5 * (own[:, 7:10] ** 2).sum(axis=1))
        total += 0.5 * (spin**2 * turning).sum(axis=1)
    return total


def bumps(spacing: float) -> HeightField:
    """Return bumps of 4 cm in all directions, 0.3 to 0.6 m long, on a grid of a spacing [m]."""
    axis, random = np.arange(-1.0, 1.0 + 0.5 * spacing, spacing), np.random.default_rng(7)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    ways = random.uniform(10.0, 20.0, 8), *random.uniform(0.0, 2.0 * np.pi, (2, 8))
    heights = [
        np.sin(k * (np.cos(a) * x + np.sin(a) * y) + b) for k, a, b in zip(*ways, strict=True)
    ]
    return HeightField(axis, axis, 0.015 * np.sum(heights, axis=0))


def on_soles(robot: Robot) -> Robot:
    """Return a robot on five points of each foot, 2 cm apart and level in its standing pose."""
    data, soles = robot.model.createData(), []
    pin.framesForwardKinematics(robot.model, data, robot.poses["standing"])
    for foot in robot.contacts:
        turn = data.oMf[robot.model.getFrameId(foot.frame)].rotation
        for i, (x, y) in enumerate([(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)]):
            place = foot.offset + turn.T @ [0.02 * x, 0.02 * y, 0.0]
            soles.append(replace(foot, name=f"{foot.name}_{i}", offset=place))
    return replace(robot, contacts=tuple(soles))


def quadruped() -> Table:
    """Return how long a step of Solo12 takes, the least of sixty rounds, switched off."""
    robot = load_robot("solo12")
    standing = np.array(robot.poses["standing"])
    plants = {
        "four feet": Plant(robot, bodies="feet"),
        "twenty points": Plant(on_soles(robot), bodies="feet"),
        "all links": Plant(robot),
        "lying": Plant(robot),
        "lying, grid of 5 cm": Plant(robot, bumps(0.05)),
        "lying, grid of 2 cm": Plant(robot, bumps(0.02)),
    }
    starts, best = {}, dict.fromkeys(plants, np.inf)
    for name, plant in plants.items():
        q = standing.copy()
        for _ in range(20):
            q[2] -= plant.gaps(plant.state(q)).min()
        starts[name] = plant.state(q)
        if "lying" in name:
            starts[name] = plant.run(starts[name], np.zeros(12), 1.5, 1500)[-1].state
    for name in [name for _ in range(60) for name in plants]:
        state, began = starts[name], perf_counter()
        for _ in range(10):
            state = plants[name].step(state, np.zeros(12), STEP).state
        best[name] = min(best[name], (perf_counter() - began) / 10)
    table = Table("Solo12", "points", "touching", "us per step", "of four feet")
    for name, plant in plants.items():
        state = starts[name]
        near = np.concatenate((plant.gaps(state), plant.pair_gaps(state))) < 1e-6
        cost = f"{1e6 * best[name]:.0f}", f"{best[name] / best['four feet']:.2f}"
        table.add_row(name, str(len(plant.contacts)), str(int(near.sum())), *cost)
    return table


def main() -> None:
    """Run all scenes in all simulators that are here, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--quadruped", action="store_true", help="time Solo12 instead")
    given = parser.parse_args()
    if given.quadruped:
        Console(width=110).print(quadruped())
        return
    engines: dict[str, Run] = {"wbc": wbc, "MuJoCo": mujoco_run}
    if find_spec("pydrake") is not None:
        engines["Drake"] = drake_run
    table = Table("scene", "", "creep [m]", "depth [m]", "made", "fastest", "us per step")
    for scene, solids in SCENES.items():
        for name, run in engines.items():
            frames, cost = run(solids, given.steps)
            last = frames[-1000:]
            depth = max(inside(solids, frame) for frame in last[::50])
            energy = energies(solids, frames)
            numbers = (
                np.linalg.norm(last[-1, 0, :3] - last[0, 0, :3]),
                depth,
                max(np.diff(energy).max(), 0.0) / abs(energy[0] - energy[-1]),
                np.abs(last[-1, :, 7:]).max(),
            )
            table.add_row(scene, name, *(f"{n:.1e}" for n in numbers), f"{1e6 * cost:.0f}")
            scene = ""
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
