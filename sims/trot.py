"""Solo12 trots at 0.5 m/s on lossy gears: level, pushed, and up a step of 5 cm.

In MuJoCo and in the library's own plant. The controller knows the losses (dissipative), takes the
gears for perfect (conservative), or knows them and lets stiction hold what it can (least torque).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from sims.closed_loop import Engine, engine_of, stairs
from sims.imperfect_loop import lossy
from sims.mesh_work import mesh_work
from sims.plots import Panel, sweep_figure, write_figures
from sims.trotter import StepUp, Trotter
from wbc import Robot
from wbc.arrays import FloatArray
from wbc.control import RestPolicy
from wbc.sim import Plant as SimPlant, Simulation, simulate
from wbc.view import LIGHT, Theme, write_playback

OUT = Path("out")
TICK = 1e-3  # [s]
SETTLED = 1.0  # [s] after which figures count
PUSH = np.array([0.0, 8.0, 0.0])  # [N] on the base for 0.1 s from 1.5 s on: 0.3 m/s sideways
ENGINES = ("MuJoCo", "wbc.sim")
SCENES = ("level", "pushed", "step")
JOINTS = ("HAA", "HFE", "KFE")
MODELS = ("dissipative", "conservative", "least torque")
SPEED, TRANSPORT, FELL = "speed [m/s]", "cost of transport [-]", "fell"


@dataclass
class Record:
    """What happened in every tick: q, v and rotor torque."""

    q: list[FloatArray] = field(default_factory=list)
    v: list[FloatArray] = field(default_factory=list)
    torque: list[FloatArray] = field(default_factory=list)


def trot(engine: Engine, robot: Robot, trotter: Trotter, scene: str, duration: float) -> Record:
    """Trot for `duration` [s], or until the base is at less than half its height."""
    record = Record()
    for tick in range(round(duration / TICK)):
        motion = engine.motion
        record.q.append(np.array(motion.position))
        record.v.append(np.array(motion.velocity))
        record.torque.append(np.array(trotter(motion)))
        pushed = scene == "pushed" and 1.5 <= tick * TICK < 1.6
        engine.advance(record.torque[-1], PUSH if pushed else np.zeros(3), TICK)
        if motion.position[2] < 0.5 * trotter.pose[2]:
            break
    return record


def figures(robot: Robot, trotter: Trotter, record: Record, duration: float) -> dict[str, float]:
    """Return the figures of a run after `SETTLED`.

    The cost of transport is the work of the driving motors over m g and the way; what they take
    back is lost.
    """
    gears, settled = robot.transmission, slice(round(SETTLED / TICK), None)
    q, v = np.array(record.q)[settled], np.array(record.v)[settled]
    fell = len(record.q) < round(duration / TICK)
    if len(q) < 2:
        return {FELL: 1.0}
    torque = np.array(record.torque)[settled]
    work, lost = mesh_work(robot, v, torque, TICK)
    way, weight = q[-1, 0] - q[0, 0], 9.81 * pin.computeTotalMass(robot.model)
    upright = [pin.Quaternion(row[3:7]).matrix()[2, 2] for row in q]
    ground = np.array([trotter.ground.at(x) for x in q[:, 0]])
    rise = q[:, 2] - ground - trotter.pose[2]
    torque = torque / gears.torque_limit
    return {
        FELL: float(fell),
        SPEED: float(way / (TICK * len(q))),
        "height, rms error [mm]": 1e3 * float(np.sqrt(np.mean(rise**2))),
        "tilt, largest [deg]": float(np.rad2deg(np.arccos(min(1.0, min(upright))))),
        "sway [mm]": 1e3 * float(np.ptp(q[:, 1])),
        "torque, rms [% of limit]": 1e2 * float(np.sqrt(np.mean(torque**2))),
        TRANSPORT: float(work * TICK * len(q) / (weight * way)),
        **{
            f"lost in the meshes of {kind} [W]": float(
                sum(w for w, name in zip(lost, gears.joints, strict=True) if name.endswith(kind))
            )
            for kind in JOINTS
        },
        "refused ticks": float(sum(not c.status.usable for c in trotter.commands)),
    }


def prepared(robot: Robot, kind: str, scene: str) -> Trotter:
    """Return the loop's controller for one of `MODELS` in one of `SCENES`."""
    model = robot.lossless() if kind == "conservative" else robot
    policy = RestPolicy.LEAST_TORQUE if kind == "least torque" else RestPolicy.NEUTRAL
    ground = StepUp(0.05 if scene == "step" else 0.0)
    return Trotter(model, np.array(robot.poses["standing"]), ground=ground, policy=policy)


def main(
    duration: float = 5.0,
    engines: Sequence[str] = ENGINES,
    scenes: Sequence[str] = SCENES,
    models: Sequence[str] = MODELS,
) -> dict[tuple[str, str, str], dict[str, float]]:
    """Return the figures by plant, scene and controller."""
    robot, found = lossy("solo12"), {}
    for name in engines:
        for scene in scenes:
            for kind in models:
                trotter = prepared(robot, kind, scene)
                engine = engine_of(name, robot, trotter.pose, trotter.ground)
                record = trot(engine, robot, trotter, scene, duration)
                found[name, scene, kind] = figures(robot, trotter, record, duration)
    return found


def film(path: Path, duration: float = 3.0) -> Path:
    """Write the playback of a trot up the step in the library's plant."""
    robot = lossy("solo12")
    trotter = prepared(robot, "dissipative", "step")
    ground = stairs(trotter.ground)
    plant = SimPlant(robot, ground)
    run: Simulation = simulate(plant, trotter, plant.state(trotter.pose), duration)
    return write_playback(path, robot, run.log, ground=ground, title="Solo12 trots up a step")


def draw(
    found: dict[tuple[str, str, str], dict[str, float]], theme: Theme = LIGHT
) -> dict[str, Figure]:
    """Return speed, cost of transport and mesh loss by joint in the first of the plants.

    What least torque does is left out: it lies on the dissipative controller's dots.
    """
    plant, shown = next(iter(found))[0], MODELS[:2]
    scenes = [scene for scene in SCENES if (plant, scene, shown[0]) in found]
    panels = []
    for figure, title in ((SPEED, "speed"), (TRANSPORT, "cost of transport")):
        points = {
            kind: (scenes, [found[plant, scene, kind].get(figure, np.nan) for scene in scenes])
            for kind in shown
        }
        panels.append(Panel(title, "", figure, {}, points))
    level = {kind: found[plant, scenes[0], kind] for kind in shown}
    lost = {
        kind: (list(JOINTS), [values[f"lost in the meshes of {j} [W]"] for j in JOINTS])
        for kind, values in level.items()
    }
    panels.append(Panel(f"mesh loss, {scenes[0]}", "joints", "lost [W]", {}, lost))
    return {"trot": sweep_figure(panels, theme=theme)}


def report(found: dict[tuple[str, str, str], dict[str, float]]) -> list[Path]:
    """Print the table; return the plot and the playback written."""
    longest = max(found.values(), key=len)
    table = Table("plant", "scene", "controller", *longest, box=None)
    for where, values in found.items():
        table.add_row(*where, *(f"{values.get(name, np.nan):.3g}" for name in longest))
    Console(width=190).print(table)
    return [*write_figures(OUT, draw(found)), film(OUT / "trot.html")]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
