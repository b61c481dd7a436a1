"""From a log to the simulator that a policy is trained in: diagnosis, export, MuJoCo.

A leg has losses that its model lacks. Logs of it are explained, the leg found is exported with its
losses, and MuJoCo moves it. The same position control then needs the same torques in MuJoCo as on
the machine; without the losses it needs others.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sims.plots import Panel, sweep_figure
from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.effects import CoulombFriction, TransmissionEfficiency
from wbc.export import export_robot, loss_numbers
from wbc.export.losses import Losses
from wbc.identification import compare, diagnose
from wbc.sim import Plane, Plant
from wbc.sim.excitation import record_with
from wbc.view.plots import write_figure

OUT = Path("out")
TICK = 1e-3  # [s], of the controller and of MuJoCo
HIDDEN = (
    TransmissionEfficiency("hip", 0.8, 0.75),
    TransmissionEfficiency("knee", 0.7, 0.5714),
    CoulombFriction("hip", 0.8),
)
Ask = Callable[[float, FloatArray, FloatArray], FloatArray]


def servo(robot: Robot) -> Ask:
    """Return a position controller of hip and knee: time, q, v -> motor torque (m,) [N m]."""
    start = robot.pose("paper")

    def asked(time: float, position: FloatArray, velocity: FloatArray) -> FloatArray:
        target = start + np.array([0.5, -0.4]) * np.sin(np.array([4.0, 6.0]) * time)
        return np.asarray(60.0 * (target - position) - 3.0 * velocity)

    return asked


def on_machine(robot: Robot, ask: Ask, duration: float) -> FloatArray:
    """Return what the motors of the plant are asked for, a row per tick (rows, m) [N m]."""
    plant = Plant(robot, terrain=Plane(height=-10.0))
    state, rows = plant.state(robot.pose("paper")), []
    for k in range(round(duration / TICK)):
        rows.append(ask(k * TICK, state.position, state.velocity))
        state = plant.step(state, rows[-1] / robot.transmission.gear_ratio, TICK).state
    return np.array(rows)


def in_mujoco(robot: Robot, ask: Ask, duration: float, with_losses: bool) -> FloatArray:
    """Return the same in MuJoCo, with the robot's losses or without."""
    import mujoco  # not a dependency of the library

    model: Any = mujoco.MjModel.from_xml_string(export_robot(robot, "mujoco").text)
    model.opt.timestep = TICK
    losses = Losses(model, loss_numbers(robot)) if with_losses else None
    data: Any = mujoco.MjData(model)
    data.qpos[:] = robot.pose("paper")
    rows = []
    for k in range(round(duration / TICK)):
        rows.append(ask(k * TICK, np.array(data.qpos), np.array(data.qvel)))
        data.ctrl[:] = rows[-1]
        if losses is not None:
            losses.apply(data)
        mujoco.mj_step(model, data)
    return np.array(rows)


def main(recorded: float = 6.0, duration: float = 2.0) -> dict[str, Any]:
    """Record the leg for `recorded` [s], explain the logs, and move the leg found in MuJoCo."""
    believed = load_robot("planar_leg_fixed").lossless()
    logs = record_with(believed, HIDDEN, duration=recorded)
    found = diagnose(believed, logs)
    ask = servo(believed)
    torques = {
        "machine": on_machine(believed.with_effects(*HIDDEN), ask, duration),
        "MuJoCo with losses": in_mujoco(found.robot, ask, duration, with_losses=True),
        "MuJoCo without": in_mujoco(found.robot, ask, duration, with_losses=False),
    }
    machine = torques["machine"]
    size = np.sqrt(np.mean(machine**2, axis=0))
    return {
        "verdict": found.verdict,
        "effects": [str(effect) for effect in found.robot.effects],
        "residuals": [compare(robot, logs).series[0] for robot in (believed, found.robot)],
        "torques": torques,
        "errors": {
            name: np.sqrt(np.mean((torque - machine) ** 2, axis=0)) / size
            for name, torque in torques.items()
        },
    }


def panels(found: dict[str, Any]) -> list[Panel]:
    """Return the log and its explanation, and the torque of the knee's motor in three places."""
    (before, after), knee = found["residuals"], 1
    shown = before.time < before.time[0] + 2.0
    time = TICK * np.arange(len(found["torques"]["machine"]))
    torques = {name: (time, torque[:, knee]) for name, torque in found["torques"].items()}
    machine = found["torques"]["machine"][:, knee]
    return [
        Panel(
            "1. log and diagnosis: knee",
            "time [s]",
            "torque not explained [N m]",
            {
                "perfect gears": (before.time[shown], before.residual[shown, knee]),
                "with the effects found": (before.time[shown], after.residual[shown, knee]),
            },
        ),
        Panel("2. exported: knee, 1 ms", "time [s]", "torque of the motor [N m]", torques),
        Panel(
            "3. how far MuJoCo is off",
            "time [s]",
            "torque of the motor [N m]",
            {
                name: (time, torque - machine)
                for name, (_, torque) in torques.items()
                if name != "machine"
            },
        ),
    ]


def report(found: dict[str, Any]) -> list[Path]:
    """Print what was found and how far MuJoCo is off; return the figure written."""
    print(f"verdict: {found['verdict']}")
    for effect in found["effects"]:
        print(f"  {effect}")
    rows = {
        name: {
            f"{joint} [%]": 100.0 * value
            for joint, value in zip(("hip", "knee"), error, strict=True)
        }
        for name, error in found["errors"].items()
        if name != "machine"
    }
    print_columns(
        "error of the motors' torque against the machine's, of its root mean square", rows
    )
    return [write_figure(OUT / "log_to_mujoco.png", sweep_figure(panels(found)))]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
