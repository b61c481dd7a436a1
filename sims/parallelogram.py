"""The same leg with its knee driven in series or through a parallelogram: who carries what?

Links, gears and motors are the same; only the topology D and the second motor's housing differ.
The parallelogram's knee motor turns with the shin against the base, q_hip + q_knee, and its hip
motor bears T_hip = tau_hip - tau_knee beside T_knee = tau_knee. A leg that balances on a point has
no hip torque: in series the knee's gear does all the work of a squat; with a parallelogram both
gears bear the same load and most of the work passes through the hip's. What that saves is the
difference between the two gears: with equal ones the losses are nearly the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sims.leg import LegControl, balanced_pose, squat, standing_torque, with_gears
from sims.plots import write_figures
from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.dynamics import evaluate
from wbc.sim import Plant, Simulation, simulate
from wbc.view import LIGHT, Theme, write_playback
from wbc.view.plots import power_figure

OUT = Path("out")


@dataclass(frozen=True)
class Squat:
    """A squat of one leg and the figures of the table."""

    robot: Robot
    run: Simulation
    figures: dict[str, float]


def run_leg(robot: Robot, duration: float, knee: float) -> Squat:
    """Squat 6 cm deep at 0.5 Hz from a pose with bent knee."""
    q = balanced_pose(robot, knee=knee)
    height = float(evaluate(robot, q, np.zeros(robot.model.nv)).center_of_mass[2])
    control, ground = LegControl(robot, squat(height, 0.03, 0.5), noise=0.0), Plant(robot)
    run = simulate(ground, control, ground.state(q), duration)
    commands = control.commands
    output = np.array([c.output_torque for c in commands])
    power = np.array([c.mesh_power for c in commands])
    gears = robot.transmission
    rows: dict[str, float] = {}
    for i, joint in enumerate(gears.joints):
        rows[f"{joint}: standing [N m]"] = round(float(standing_torque(robot, q)[i]), 9)
        rows[f"{joint}: torque rms [N m]"] = float(np.sqrt(np.mean(output[:, i] ** 2)))
        rows[f"{joint}: motor drives [J]"] = float(np.maximum(power[:, i], 0.0).sum() * 1e-3)
        rows[f"{joint}: joint drives [J]"] = float(np.minimum(power[:, i], 0.0).sum() * 1e-3)
    flow, error = run.audit.flow, np.array(control.errors)[len(commands) // 4 :, 0]
    return Squat(
        robot,
        run,
        {
            **rows,
            "motor work [J]": flow.motor,
            "mesh losses [J]": flow.mesh,
            "height error, rms [mm]": 1e3 * float(np.sqrt(np.mean(error**2))),
            "unsolved ticks": sum(not c.status.usable for c in commands),
        },
    )


def main(duration: float = 4.0, knee: float = 0.8) -> dict[str, Squat]:
    """Squat for `duration` [s] with the paper's gears and with two of equal efficiency."""
    serial, parallel = load_robot("planar_leg_strong"), load_robot("parallelogram_leg")
    legs = {
        "serial": serial,
        "parallelogram": parallel,
        "serial, 0.75": with_gears(serial, 0.75),
        "parall., 0.75": with_gears(parallel, 0.75),
    }
    return {name: run_leg(leg, duration, knee) for name, leg in legs.items()}


def draw(legs: dict[str, Squat], theme: Theme = LIGHT) -> dict[str, Figure]:
    """Return the power through the gears of each leg."""
    return {
        f"squat_{name}": power_figure(leg.robot, leg.run.log, theme) for name, leg in legs.items()
    }


def report(legs: dict[str, Squat]) -> list[Path]:
    """Print the table; return the plots of power and the playback written."""
    title = "squatting 6 cm: eta_f 0.8 and 0.7, or both 0.75"
    print_columns(title, {name: leg.figures for name, leg in legs.items()})
    shown = {name: legs[name] for name in ("serial", "parallelogram")}
    files = write_figures(OUT, draw(shown))
    ours = shown["parallelogram"]
    page = OUT / "parallelogram.html"
    return [*files, write_playback(page, ours.robot, ours.run.log, title="Parallelogram")]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
