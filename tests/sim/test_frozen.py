"""Runs of the plant that were recorded once: a change of its loops must not change them unseen.

`python -m tests.sim.test_frozen` records them anew; a commit that does so says why.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from sims.leg import balanced_pose, with_gears
from tests.sim.random_robots import geared, random_robot, softened
from wbc import Robot, load_robot
from wbc.effects import EFFECTS, CoulombFriction, ViscousFriction
from wbc.sim import Box, HeightField, Plane, Plant, SimState, Sphere, Stairs, Together

DATA = Path(__file__).with_name("frozen.json")
MARKS = (20, 200)
Scene = Callable[[], tuple[Plant, SimState]]


def _solo(*effects: tuple[str, dict[str, float]]) -> Robot:
    robot = load_robot("solo12")
    joints = robot.transmission.joints
    return robot.with_effects(*(EFFECTS[n].at(j, v) for n, v in effects for j in joints))


def _standing(robot: Robot, terrain=None, lift: float = 0.0, **plant) -> tuple[Plant, SimState]:
    made, pose = Plant(robot, terrain or Plane(), **plant), np.array(robot.pose())
    pose[2] += lift
    return made, made.state(pose, lifted=True)


def _leg(lift: float = 0.0, **changes) -> tuple[Plant, SimState]:
    plant = Plant(geared(LEG, **changes))
    return plant, plant.state(balanced_pose(LEG, lift), lifted=True)


def _random(seed: int, terrain=None, *, soft: bool = False, coupled: bool = False, back=0.0):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, ("planar", "free")[seed % 2], 0.8, 0.6, 0.7, coupled)
    robot = softened(rng, robot) if soft else robot
    plant = Plant(robot, terrain or Plane.slope(0.1), restitution=back)
    q = pin.integrate(robot.model, robot.neutral(), 0.4 * rng.normal(size=robot.model.nv))
    return plant, plant.state(q, 0.3 * rng.normal(size=robot.model.nv), lifted=True)


def _on_its_foot(leg: Robot) -> tuple[Plant, SimState]:
    plant = Plant(leg)
    return plant, plant.state(balanced_pose(leg))


LEG = load_robot("planar_leg_strong")
PARALLEL = LEG.transmission.replace(topology=np.array([[1.0, 0.0], [-1.0, 1.0]]))
RUBS = CoulombFriction("hip", 0.5), ViscousFriction("knee", 0.2)


def _field() -> HeightField:
    axis, rng = np.linspace(-3.0, 3.0, 25), np.random.default_rng(5)
    return HeightField(axis, axis, 0.05 * rng.normal(size=(25, 25)))


BOX, BALL = Box([0.2, 0.1, 0.0], [0.1, 0.2, 0.04]), Sphere([-0.2, 0.1, -0.5], 0.51)
SCENES: dict[str, Scene] = {
    "leg": _leg,
    "leg lands": lambda: _leg(0.05),
    "solo12": lambda: _standing(_solo()),
    "solo12 with friction and torque constants": lambda: _standing(
        _solo(
            ("coulomb_friction", {"level": 0.1}),
            ("viscous_friction", {"coefficient": 0.05}),
            ("torque_constant", {"factor": 1.02}),
        )
    ),
    "soft leg": lambda: _leg(0.02, stiffness=500.0, damping=0.5),
    "loose leg": lambda: _leg(0.02, stiffness=2000.0, damping=2.0, backlash=0.01),
    "leg with hard play": lambda: _leg(0.02, backlash=0.02),
    "stairs": lambda: _standing(_solo(), Stairs([0.1], [0.0, 0.03])),
    "boxes and balls": lambda: _standing(_solo(), Together([Plane(), BOX, BALL]), lift=0.03),
    "field": lambda: _standing(_solo(), _field()),
    "bounces": lambda: _random(3, back=0.6),
    "planar, soft": lambda: _random(4, soft=True),
    "free, soft": lambda: _random(7, soft=True),
    "free, coupled rotors": lambda: _random(9, coupled=True),
    "planar, coupled rotors": lambda: _random(12, coupled=True, back=0.5),
    # Joint friction beside a parallelogram has rows of its own.
    "leg that rubs beside a parallelogram": lambda: _on_its_foot(
        LEG.with_transmission(PARALLEL).with_effects(*RUBS)
    ),
    "leg on self-locking gears": lambda: _on_its_foot(with_gears(LEG, efficiency=0.49)),
}
TOLERANCE = 1e-6


def _run(scene: Scene) -> list[list[float]]:
    plant, state = scene()
    robot, rows = plant.robot, []
    gears, start = robot.transmission, state.position
    for step in range(MARKS[-1]):
        angle = (state.position - start)[robot.actuated_position]
        torque = -8.0 * (angle + 0.025 * state.velocity[robot.actuated])
        state = plant.step(state, gears.motor_from_joint @ torque / gears.gear_ratio, 1e-3).state
        if step + 1 in MARKS:
            rows.append([*state.position.tolist(), *state.velocity.tolist()])
    return rows


@pytest.mark.parametrize("name", SCENES)
def test_runs_end_where_they_were_recorded(name: str) -> None:
    found, recorded = _run(SCENES[name]), json.loads(DATA.read_text())[name]
    for row, expected in zip(found, recorded, strict=True):
        assert row == pytest.approx(expected, abs=TOLERANCE)


if __name__ == "__main__":
    runs = {name: _run(scene) for name, scene in SCENES.items()}
    DATA.write_text(json.dumps(runs, indent=1) + "\n")
