"""TALOS steps on the spot and forward on lossy gears, in the library's plant or in MuJoCo.

The controller knows the losses (dissipative) or takes the gears for perfect (conservative).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from sims.closed_loop import Engine, OwnPlant
from sims.stepper import Stepper
from wbc import Robot, load_robot
from wbc.arrays import FloatArray

TICK = 1e-3  # [s]
_PUSHED = 1.9  # [s], while the second foot swings
SETTLED = 0.5  # [s] of standing, after which figures count
LENGTHS = {"on the spot": 0.0, "forward": 0.135}  # [m] a step of 0.9 s: 0.15 m/s
MODELS = ("dissipative", "conservative")
FELL, DONE, POINT = "fell", "steps", "capture point, rms error [mm]"
HEIGHT, WAY = "pelvis, largest change of height [mm]", "way [m]"


def walk(
    engine: Engine, robot: Robot, stepper: Stepper, push: Sequence[float] = (0.0, 0.0, 0.0)
) -> dict[str, float]:
    """Step until the plan is over or the pelvis is below half its height; return the figures.

    `push` is a force (3,) [N] on the pelvis, for 0.1 s while the second foot swings.
    """
    errors, heights, torques = [], [], []
    first, last = stepper.pose[:3], engine.motion.position
    for tick in range(len(stepper.plan.point)):
        torque: FloatArray = stepper(engine.motion)
        pushed = _PUSHED <= tick * TICK < _PUSHED + 0.1
        engine.advance(torque, np.array(push) if pushed else np.zeros(3), TICK)
        last = engine.motion.position
        if tick * TICK >= SETTLED:
            errors.append(stepper.point_error())
            heights.append(last[2] - first[2])
            torques.append(torque / robot.transmission.torque_limit)
        if last[2] < 0.5 * first[2]:
            break
    return {
        FELL: float(last[2] < 0.5 * first[2]),
        DONE: float(stepper.done),
        WAY: float(last[0] - first[0]),
        POINT: 1e3 * float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1)))),
        HEIGHT: 1e3 * float(np.abs(heights).max()),
        "torque, rms [% of limit]": 1e2 * float(np.sqrt(np.mean(np.square(torques)))),
        "refused ticks": float(sum(not c.status.usable for c in stepper.commands)),
    }


def main(
    steps: int = 6,
    engines: Sequence[str] = ("wbc.sim",),
    ways: Sequence[str] = tuple(LENGTHS),
    models: Sequence[str] = MODELS,
) -> dict[tuple[str, str, str], dict[str, float]]:
    """Return the figures by plant, way of stepping and controller."""
    robot, found = load_robot("talos"), {}
    pose = np.array(robot.poses["half_sitting"])
    for name in engines:
        for way in ways:
            for kind in models:
                model = robot.lossless() if kind == "conservative" else robot
                stepper = Stepper(model, pose, steps, LENGTHS[way], TICK)
                found[name, way, kind] = walk(_engine(name, robot, pose), robot, stepper)
    return found


def pushed(
    push: Sequence[float], *, adjusts: bool = True, steps: int = 6, engine: str = "wbc.sim"
) -> dict[str, float]:
    """Return the figures of steps on the spot with a push (3,) [N], losses known."""
    robot = load_robot("talos")
    pose = np.array(robot.poses["half_sitting"])
    stepper = Stepper(robot, pose, steps, 0.0, TICK, adjusts)
    return walk(_engine(engine, robot, pose), robot, stepper, push)


def _engine(name: str, robot: Robot, pose: FloatArray) -> Engine:
    if name == "wbc.sim":
        return OwnPlant(robot, pose)
    from sims.mujoco_plant import MujocoPlant  # MuJoCo is needed only here

    return MujocoPlant(robot, pose)


def report(found: dict[tuple[str, str, str], dict[str, float]]) -> None:
    """Print the table."""
    table = Table("plant", "steps", "controller", *next(iter(found.values())), box=None)
    for where, values in found.items():
        table.add_row(*where, *(f"{value:.3g}" for value in values.values()))
    Console(width=190).print(table)


if __name__ == "__main__":
    report(main())
