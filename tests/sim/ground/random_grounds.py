"""Random grounds, robots that stand over them, and what a step makes of their energy."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from tests.sim.random_robots import BASES, random_robot, softened, unit
from wbc import Robot, sim

GROUNDS = ("plane", "stairs", "boxes", "balls", "field")


def random_ground(rng: np.random.Generator, kind: str) -> sim.Terrain:
    """Return a ground of some kind about the origin, nowhere higher than 0.6 m."""
    if kind == "plane":
        return sim.Plane(np.array([*rng.uniform(-0.5, 0.5, 2), 1.0]))
    if kind == "stairs":
        edges = np.cumsum(rng.uniform(0.02, 0.4, 6)) - 0.6
        return sim.Stairs(edges, rng.uniform(-0.1, 0.2, 7))
    if kind == "boxes":
        turns = [pin.Quaternion(*unit(rng, 4)).toRotationMatrix() for _ in range(4)]
        parts = [sim.Box(_place(rng), rng.uniform(0.1, 0.5, 3), R) for R in turns]
        return sim.Together((sim.Plane(height=-0.1), *parts))
    if kind == "balls":
        balls = [sim.Sphere(_place(rng), rng.uniform(0.05, 0.3)) for _ in range(4)]
        return sim.Together((sim.Plane(), *balls))
    x = np.linspace(-2.0, 2.0, 21)
    return sim.HeightField(x, x, 0.08 * rng.normal(size=(21, 21)))


def _place(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-0.5, 0.5, 3) * [1, 1, 0.3]


def random_scene(
    rng: np.random.Generator,
    base: str,
    ground: str,
    restitution: float,
    least: float = -0.2,
    *,
    soft: bool = False,
) -> tuple[sim.Plant, sim.SimState]:
    """Return a robot with lossy gears, stops and round feet just over a ground, in motion.

    `least` is the lowest backward efficiency; below zero gears lock. `soft` lets gears yield.
    """
    eta_f = rng.uniform(0.4, 1.0)
    eta_b = rng.uniform(least, 1.0)
    robot = random_robot(rng, base, eta_f, eta_b, rng.uniform(0.0, 1.5), coupled=False)
    robot = softened(rng, robot) if soft else robot
    q = pin.integrate(robot.model, robot.neutral(), rng.uniform(-1.0, 1.0, robot.model.nv))
    robot = _with_stops(rng, robot, q)
    radius = rng.choice([0.0, 0.03])
    robot = replace(robot, contacts=tuple(replace(c, radius=radius) for c in robot.contacts))
    plant = sim.Plant(robot, random_ground(rng, ground), restitution)
    if base != "fixed":
        q[1 if base == "planar" else 2] += 3.0
        for _ in range(60):  # down until a point touches: no gap is larger than the distance
            q[1 if base == "planar" else 2] -= plant.gaps(plant.state(q)).min()
    elif plant.gaps(plant.state(q)).min() < 0.0:
        plant = sim.Plant(robot, sim.Plane(height=-10.0), restitution)
    # A height field's gap is not quite the distance: the way down may end inside.
    velocity = 2.0 * rng.normal(size=robot.model.nv)
    return plant, plant.state(q, velocity, lifted=base != "fixed")


def drawn_scene(
    seed: int, ground: str, *, soft: bool = False
) -> tuple[sim.Plant, sim.SimState, np.ndarray, float]:
    """Return a scene, a rotor torque for it and a step between 10 us and 30 ms."""
    rng = np.random.default_rng(seed)
    base, back = str(rng.choice(BASES)), float(rng.choice([0.0, 0.5, 1.0]))
    plant, state = random_scene(rng, base, ground, back, soft=soft)
    dt = 10.0 ** rng.uniform(-5.0, -1.5)
    ratio, strength = plant.robot.transmission.gear_ratio, float(rng.choice([0.0, 10.0]))
    return plant, state, strength * rng.uniform(-1.0, 1.0, len(ratio)) / np.abs(ratio), dt


def _with_stops(rng: np.random.Generator, robot: Robot, q: np.ndarray) -> Robot:
    """Put every driven joint within a tenth of a radian of a stop."""
    model = robot.model.copy()
    low, high = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    for place in robot.actuated_position.tolist():
        low[place] = q[place] - rng.uniform(0.0, 0.1)
        high[place] = q[place] + rng.uniform(0.0, 0.1)
    model.lowerPositionLimit, model.upperPositionLimit = low, high
    return replace(robot, model=model)


def made_by_rows(result: sim.StepResult) -> float:
    """Return the most that the rows of a part, or an impact, made of the energy, as a share.

    That is the kinetic energy of links and rotors at the end, less that without any row: what
    pinocchio's inertia and forces make of the start alone, at the inertia of the middle. A free
    base carries its momentum there. Soft gears push at the links; their springs are no row.
    """
    drive, model = result.setup.drive, result.setup.robot.model
    data, reflected, ratio = (
        model.createData(),
        drive.gears.reflected_inertia,
        drive.gears.gear_ratio,
    )
    bases = result.setup.plant.placed.bases[:, 2:4].tolist()
    b = [row for first, size in bases for row in range(first, first + size)]

    def inertia_at(q: np.ndarray) -> np.ndarray:
        return np.triu(pin.crba(model, data, q)) + np.triu(data.M, 1).T

    def energy(q: np.ndarray, v: np.ndarray, motor: np.ndarray) -> float:
        return 0.5 * (v @ inertia_at(q) @ v + (reflected * motor**2)[~drive.loose].sum())

    pairs = []
    for one in result.impacts:
        q, motor = one.state.position, drive.motion(one.state)[1]
        pairs.append((energy(q, one.before, motor), energy(q, one.after, drive.rows @ one.after)))
    for part in result.parts:
        end, q, v = part.end, part.end["before"], part.end["speed"]
        links, bias = inertia_at(q), pin.nonLinearEffects(model, data, q, v)
        bases_turn = (bias - pin.computeGeneralizedGravity(model, data, q))[b]
        bias = bias - links[:, b] @ np.linalg.solve(links[np.ix_(b, b)], bases_turn)
        push = drive.rows.T @ np.where(drive.loose, end["mesh_impulse"], 0.0)
        free = v + np.linalg.solve(links, part.step * (end["force"] - bias) + push)
        motor = drive.motion(part.start)[1] + ratio * part.step * end["torque"] / reflected
        pairs.append((energy(q, free, motor), energy(q, end["after"], end["motor_speed"])))
    return max(((has - had) / (1e-3 + had) for had, has in pairs), default=-np.inf)
