"""Pictures of data pages: a robot simulated from one measured state, beside the log.

python -m benchmarks.open_loop_picture FITTED.toml LOG JOINT START SECONDS PICTURE
    [--columns MAP.toml]

FITTED.toml is what `wbc diagnose --save` wrote; the robot as given is the same without its effects.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from wbc.effects import load_robot
from wbc.identification.open_loop.simulated import SimulatedLog
from wbc.identification.records.preparation import prepare
from wbc.measurement import load_logs


def main(given: argparse.Namespace) -> None:
    """Simulate the joint twice from the same state, and draw both beside the measurement."""
    fitted = load_robot(given.fitted)
    gears = fitted.transmission
    ratios = dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))
    (log,) = load_logs([given.log], given.columns, gear_ratios=ratios)
    (record,) = prepare(fitted.without_effects().lossless(), [log])
    horizons = np.linspace(0.02, given.seconds, 100)
    row = fitted.single_joints.index(given.joint)
    figure, axes = plt.subplots(figsize=(7.2, 2.8), dpi=120)
    for robot, label, colour in (
        (fitted.without_effects(), "as given", "#b04a3a"),
        (fitted, "with what was found", "#2a6f97"),
    ):
        simulated = SimulatedLog.of(robot, log, record)
        missed, moved = simulated.missed(given.start, horizons)
        if label == "as given":
            axes.plot(horizons, moved[row], "k", lw=3, alpha=0.3, label="measured")
        axes.plot(horizons, moved[row] + missed[row], color=colour, label=label)
    axes.set(xlabel="time since the start [s]", ylabel=f"{given.joint} moved [rad]")
    axes.set_ylim(1.6 * np.nanmin(moved[row]) - 0.2, 1.6 * np.nanmax(moved[row]) + 0.2)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(given.picture)


if __name__ == "__main__":
    reader = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    reader.add_argument("fitted")
    reader.add_argument("log")
    reader.add_argument("joint")
    reader.add_argument("start", type=float)
    reader.add_argument("seconds", type=float)
    reader.add_argument("picture", type=Path)
    reader.add_argument("--columns")
    main(reader.parse_args())
