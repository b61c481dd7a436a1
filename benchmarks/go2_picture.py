"""The picture of docs/measurements/data/go2.md: torque left over speed, before and after a fit.

python -m benchmarks.go2_picture DATA docs/images/go2_calf.png
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.recorded import MACHINES, ROBOTS
from wbc.effects import CoulombFriction, RotorInertia, TorqueOffset, ViscousFriction, load_robot
from wbc.identification.answer.series import series_of
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import load_logs

JOINT = "RL_calf_joint"
KINDS = (CoulombFriction, RotorInertia, ViscousFriction, TorqueOffset)


def main(data: Path, target: Path) -> None:
    """Fit four effects in every joint, print them and what is left, draw the worst joint."""
    robot = load_robot("go2")
    logs = load_logs([str(data / MACHINES["go2"])], ROBOTS / "go2" / "columns.toml")
    problem = EstimationProblem.from_logs(robot, logs)
    joints = robot.transmission.joints
    fit = problem.fit([kind.at(joint, {}) for kind in KINDS for joint in joints])
    for effect in fit.effects:
        print(effect.name, effect.where, *(f"{value:.3g}" for value in effect.values.values()))
    left = np.concatenate([s.residual for s in series_of(fit.robot, problem.records)])
    print(
        "left [N m]",
        dict(zip(joints, np.sqrt(np.mean(left**2, axis=0)).round(3).tolist(), strict=True)),
    )
    figure, axes = plt.subplots(figsize=(7.2, 2.8), dpi=120)
    row, speed = joints.index(JOINT), robot.velocity_index(JOINT)
    for model, label, colour in (
        (robot, "as drawn", "#b04a3a"),
        (fit.robot, "with friction, rotor inertia and offset", "#2a6f97"),
    ):
        pairs = list(zip(problem.records, series_of(model, problem.records), strict=True))
        x = [r.condense_driven(r.motion.velocity)[:, speed] for r, _ in pairs]
        y = [s.measured[:, row] - s.modelled[:, row] for _, s in pairs]
        axes.plot(np.concatenate(x), np.concatenate(y), ".", ms=2, color=colour, label=label)
    axes.set(xlabel=f"speed of {JOINT} [rad/s]", ylabel="torque left [N m]", ylim=(-4.0, 4.0))
    axes.legend(fontsize=8, markerscale=4)
    axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(target)


if __name__ == "__main__":
    reader = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    reader.add_argument("data", type=Path)
    reader.add_argument("picture", type=Path)
    given = reader.parse_args()
    main(given.data, given.picture)
