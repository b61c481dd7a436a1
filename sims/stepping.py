"""TALOS steps on lossy gears: on the spot, pushed, forward and up 5 cm; here and in MuJoCo.

The controller knows the losses (dissipative), takes the gears for perfect (conservative), or knows
them and lets stiction hold what it can (least torque).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from sims.closed_loop import Engine, engine_of, stairs
from sims.mesh_work import mesh_work
from sims.plots import Panel, sweep_figure, write_figures
from sims.stepper import Stepper
from sims.trotter import StepUp
from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.control import RestPolicy
from wbc.sim import Plant as SimPlant, Simulation, simulate
from wbc.view import LIGHT, Theme, write_playback

OUT = Path("out")
TICK = 1e-3  # [s]
_PUSHED = 1.9  # [s], while the second foot swings
SETTLED = 0.5  # [s] of standing, after which figures count
LENGTH = 0.135  # [m] a step of 0.9 s: 0.15 m/s
EDGE = 0.17  # [m], 5 cm ahead of the toes
PUSH = (250.0, 0.0, 0.0)  # [N] on the pelvis
ENGINES, SCENES = ("MuJoCo", "wbc.sim"), ("on the spot", "forward", "pushed", "step")
MODELS = ("dissipative", "conservative", "least torque")
FELL, DONE, POINT = "fell", "steps", "capture point, rms error [mm]"
HEIGHT, WAY = "centre of mass, largest error of height [mm]", "way [m]"
TRANSPORT, REFUSED = "cost of transport [-]", "refused ticks"
JOINTS = {"hips": r"leg_\w+_[123]_", "knees": r"leg_\w+_4_", "ankles": r"leg_\w+_[56]_"}
REST = "torso, arms and head"


def walk(
    engine: Engine, robot: Robot, stepper: Stepper, push: Sequence[float] = (0.0, 0.0, 0.0)
) -> dict[str, float]:
    """Step until the plan is over or the pelvis is below half its height; return the figures.

    `push` is a force (3,) [N] on the pelvis, for 0.1 s while the second foot swings. The cost of
    transport is the work of the driving motors over m g and the way; what they take back is lost.
    """
    errors, heights, torques, speeds = [], [], [], []
    first, last = stepper.pose[:3], engine.motion
    for tick in range(len(stepper.plan.point)):
        torque: FloatArray = stepper(engine.motion)
        pushed = _PUSHED <= tick * TICK < _PUSHED + 0.1
        engine.advance(torque, np.array(push) if pushed else np.zeros(3), TICK)
        last = engine.motion
        if tick * TICK >= SETTLED:
            errors.append(stepper.point_error())
            heights.append(stepper.height_error())
            torques.append(torque)
            speeds.append(np.array(last.velocity))
        if last.position[2] < 0.5 * first[2]:
            break
    way = float(last.position[0] - first[0])
    work, lost = mesh_work(robot, np.array(speeds), np.array(torques), TICK)
    weight = 9.81 * pin.computeTotalMass(robot.model)
    share = np.array(torques) / robot.transmission.torque_limit
    return {
        FELL: float(last.position[2] < 0.5 * first[2]),
        DONE: float(stepper.done),
        WAY: way,
        POINT: 1e3 * float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1)))),
        HEIGHT: 1e3 * float(np.abs(heights).max()),
        "torque, rms [% of limit]": 1e2 * float(np.sqrt(np.mean(np.square(share)))),
        TRANSPORT: work * TICK * len(speeds) / (weight * way) if way > LENGTH else np.nan,
        "driving motors [W]": work,
        **_lost_by_joint(robot, lost),
        REFUSED: float(sum(not c.status.usable for c in stepper.commands)),
    }


def _lost(kind: str) -> str:
    return f"lost in the meshes of {kind} [W]"


def _lost_by_joint(robot: Robot, lost: FloatArray) -> dict[str, float]:
    """Return what the gears (m,) lose, by kind of joint."""
    found = dict.fromkeys([_lost(kind) for kind in (*JOINTS, REST)], 0.0)
    for joint, watts in zip(robot.transmission.joints, lost.tolist(), strict=True):
        kinds = [kind for kind, pattern in JOINTS.items() if re.match(pattern, joint)]
        found[_lost(kinds[0] if kinds else REST)] += watts
    return found


def prepared(robot: Robot, kind: str, scene: str, steps: int = 6) -> Stepper:
    """Return the loop's controller for one of `MODELS` in one of `SCENES`."""
    model = robot.lossless() if kind == "conservative" else robot
    return Stepper(
        model,
        np.array(robot.poses["half_sitting"]),
        steps,
        LENGTH if scene in ("forward", "step") else 0.0,
        TICK,
        policy=RestPolicy.LEAST_TORQUE if kind == "least torque" else RestPolicy.NEUTRAL,
        ground=StepUp(0.05 if scene == "step" else 0.0, EDGE),
    )


def main(
    steps: int = 6,
    engines: Sequence[str] = ENGINES,
    scenes: Sequence[str] = SCENES,
    models: Sequence[str] = MODELS,
) -> dict[tuple[str, str, str], dict[str, float]]:
    """Return the figures by plant, scene and controller."""
    robot, found = load_robot("talos"), {}
    for name in engines:
        for scene in scenes:
            for kind in models:
                stepper = prepared(robot, kind, scene, steps)
                push = PUSH if scene == "pushed" else (0.0, 0.0, 0.0)
                engine = engine_of(name, robot, stepper.pose, stepper.ground)
                found[name, scene, kind] = walk(engine, robot, stepper, push)
    return found


def pushed(
    push: Sequence[float], *, adjusts: bool = True, steps: int = 6, engine: str = "wbc.sim"
) -> dict[str, float]:
    """Return the figures of steps on the spot with a push (3,) [N], losses known."""
    robot = load_robot("talos")
    stepper = Stepper(robot, np.array(robot.poses["half_sitting"]), steps, 0.0, TICK, adjusts)
    return walk(engine_of(engine, robot, stepper.pose, stepper.ground), robot, stepper, push)


def film(path: Path, steps: int = 4) -> Path:
    """Write the playback of steps up 5 cm in the library's plant."""
    robot = load_robot("talos")
    stepper = prepared(robot, "dissipative", "step", steps)
    ground = stairs(stepper.ground)
    plant = SimPlant(robot, ground)
    duration = TICK * len(stepper.plan.point)
    run: Simulation = simulate(plant, stepper, plant.state(stepper.pose), duration)
    return write_playback(path, robot, run.log, ground=ground, title="TALOS steps up 5 cm")


def draw(
    found: dict[tuple[str, str, str], dict[str, float]], theme: Theme = LIGHT
) -> dict[str, Figure]:
    """Return error of the capture point, cost of transport and mesh loss by joint in one plant."""
    plant = next(iter(found))[0]
    scenes = [scene for scene in SCENES if (plant, scene, MODELS[0]) in found]
    models = [kind for kind in MODELS if (plant, scenes[0], kind) in found]
    panels = []
    for figure, title, shown in (
        (POINT, "capture point", scenes),
        (TRANSPORT, "cost of transport", [s for s in scenes if s in ("forward", "step")]),
    ):
        points = {k: (shown, [found[plant, s, k][figure] for s in shown]) for k in models}
        panels.append(Panel(title, "", figure, {}, points))
    scene = "forward" if "forward" in scenes else scenes[0]
    kinds = [*JOINTS, REST]
    lost = {k: (kinds, [found[plant, scene, k][_lost(j)] for j in kinds]) for k in models}
    panels.append(Panel(f"mesh loss, {scene}", "joints", "lost [W]", {}, lost))
    return {"stepping": sweep_figure(panels, theme=theme)}


def report(found: dict[tuple[str, str, str], dict[str, float]]) -> list[Path]:
    """Print the table; return the plot and the playback written."""
    table = Table("plant", "scene", "controller", *next(iter(found.values())), box=None)
    for where, values in found.items():
        table.add_row(*where, *(f"{value:.3g}" for value in values.values()))
    Console(width=220).print(table)
    return [*write_figures(OUT, draw(found)), film(OUT / "stepping.html")]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
