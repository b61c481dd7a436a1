"""Solo12 and Talos stand, squat and are pushed: in MuJoCo and in the library's own plant.

Both plants have lossy gears; the controller knows the losses (dissipative) or not (conservative).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from rich.console import Console
from rich.table import Table

from sims.legged import Act, CenterOfMass, com_reference, controller, pushed, squat, stand
from sims.trotter import StepUp
from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.robot import Motion
from wbc.sim import Plant, SensorNoise, Stairs, Terrain, TorqueLag

TICK = 1e-3
LEVEL = StepUp()
PUSH = {"solo12": np.array([0.0, 8.0, 0.0]), "talos": np.array([0.0, 150.0, 0.0])}
ERROR, TRAVEL = "centre of mass, rms error [mm]", "torque travel [limits/s]"
DEPTH = {"solo12": 0.04, "anymal": 0.06, "talos": 0.06}


class Engine(Protocol):
    """What the loop needs of a plant."""

    @property
    def motion(self) -> Motion:
        """The state."""

    def advance(self, rotor_torque: FloatArray, push: FloatArray, time: float) -> None:
        """Go on for `time` [s] under rotor torques (m,) and a force (3,) [N] on the base."""


class OwnPlant:
    """The library's plant behind the same two methods."""

    def __init__(self, robot: Robot, position: FloatArray, ground: Terrain | None = None) -> None:
        """Place the robot at q (nq,) at rest, on level ground unless another is given."""
        self._plant = Plant(robot) if ground is None else Plant(robot, ground)
        self._state = self._plant.state(position)
        self._force = np.zeros(robot.model.nv)

    @property
    def motion(self) -> Motion:
        """The state."""
        return Motion(self._state.position, self._state.velocity)

    def advance(self, rotor_torque: FloatArray, push: FloatArray, time: float) -> None:
        """Go on for `time` [s] under rotor torques (m,) and a force (3,) [N] on the base."""
        x, y, z, w = self._state.position[3:7]
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        self._force[:3] = turn.T @ push
        self._state = self._plant.step(self._state, rotor_torque, time, self._force).state


def run(
    engine: Engine,
    robot: Robot,
    model: Robot,
    act: Act,
    duration: float,
    noise: SensorNoise | None = None,
    lag: TorqueLag | None = None,
) -> dict[str, float]:
    """Run one loop; return tracking and torque figures over all but the first 0.2 s."""
    control, com = controller(robot, model), CenterOfMass(robot)
    start = com(engine.motion)
    errors, torques, refused = [], [], 0
    for tick in range(round(duration / TICK)):
        height, push = act(tick * TICK)
        motion = engine.motion
        target, wanted = com_reference(start, height)
        seen = motion if noise is None else noise(motion)
        command = control.step(seen, {"center_of_mass": wanted})
        refused += not command.status.usable
        errors.append(com(motion) - target)
        torques.append(command.rotor_torque)
        delivered = command.rotor_torque if lag is None else lag(command.rotor_torque, TICK)
        engine.advance(delivered, push, TICK)
    return tracking(robot, errors, torques, refused)


def tracking(
    robot: Robot, errors: Sequence[FloatArray], torques: Sequence[FloatArray], refused: int
) -> dict[str, float]:
    """Return the figures of a run but for its first 0.2 s.

    Args:
        robot: whose torque limits count.
        errors: of the centre of mass per tick, (1,) or (3,) [m].
        torques: commanded on the rotors per tick, (m,) [N m].
        refused: ticks without a usable command.
    """
    settled = slice(round(0.2 / TICK), None)
    size = np.linalg.norm(np.array(errors)[settled], axis=1)
    torque = (np.array(torques) / robot.transmission.torque_limit)[settled]
    travel = np.abs(np.diff(torque, axis=0)).sum(axis=1).mean() / TICK
    return {
        ERROR: 1e3 * float(np.sqrt(np.mean(size**2))),
        "centre of mass, largest error [mm]": 1e3 * float(size.max()),
        "torque, rms [% of limit]": 1e2 * float(np.sqrt(np.mean(torque**2))),
        TRAVEL: float(travel),
        "refused ticks": refused,
    }


def main(
    duration: float = 2.0,
    robots: Sequence[str] = ("solo12", "talos"),
    engines: Sequence[str] = ("MuJoCo", "wbc.sim"),
) -> dict[tuple[str, str, str, str], dict[str, float]]:
    """Return the figures by robot, engine, act and controller."""
    found = {}
    for name in robots:
        robot = load_robot(name)
        pose = next(iter(robot.poses.values()))
        acts = {
            "stand": stand,
            "squat": squat(DEPTH[name], 1.0),
            "push": pushed(PUSH[name], 0.3 * duration, 0.1),
        }
        for engine in engines:
            for act, play in acts.items():
                for kind, model in (("dissipative", robot), ("conservative", robot.lossless())):
                    plant = engine_of(engine, robot, np.array(pose))
                    found[name, engine, act, kind] = run(plant, robot, model, play, duration)
    return found


def engine_of(name: str, robot: Robot, pose: FloatArray, ground: StepUp = LEVEL) -> Engine:
    """Return "MuJoCo" or the library's own plant, "wbc.sim", with a robot in a pose."""
    if name == "wbc.sim":
        return OwnPlant(robot, pose, stairs(ground) if ground.height else None)
    from sims.mujoco_plant import MujocoPlant  # MuJoCo is needed only here

    return MujocoPlant(robot, pose, slabs=[(ground.edge, ground.height)] if ground.height else [])


def stairs(ground: StepUp) -> Stairs:
    """Return the ground for the library's plant."""
    return Stairs(edges=np.array([ground.edge]), heights=np.array([0.0, ground.height]))


if __name__ == "__main__":
    results = main()
    table = Table("robot", "plant", "act", "controller", *next(iter(results.values())), box=None)
    for where, figures in results.items():
        table.add_row(*where, *(f"{value:.3g}" for value in figures.values()))
    Console(width=150).print(table)
