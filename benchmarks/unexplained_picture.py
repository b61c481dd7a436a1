"""Pictures of data pages: torque that the model leaves unexplained, before and after.

python -m benchmarks.unexplained_picture ROBOT FITTED.toml LOG PICTURE.png
    [--columns MAP.toml] [--joints JOINT...]

FITTED.toml is what `wbc diagnose --save` wrote. A second picture, PICTURE_dark.png, is for dark
pages.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt

from wbc.effects import load_robot
from wbc.measurement import load_logs
from wbc.view import DARK, LIGHT
from wbc.view.plots import unexplained_figure, write_figure
from wbc.view.residuals import LogResiduals, residuals_of


def main(given: argparse.Namespace) -> None:
    """Draw the first log that is named; the root mean squares are those of all of them."""
    robot = load_robot(given.robot)
    gears = robot.transmission
    ratios = dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))
    logs = load_logs([given.log], given.columns, gear_ratios=ratios)
    residuals = residuals_of(robot, load_robot(given.fitted), logs)
    if given.joints:
        residuals = at_joints(residuals, given.joints)
    for theme, ending in ((LIGHT, ""), (DARK, "_dark")):
        figure = unexplained_figure(residuals, "with what was found", theme)
        path = given.picture.with_stem(given.picture.stem + ending)
        write_figure(path, figure, resolution=120.0)
        plt.close(figure)


def at_joints(residuals: LogResiduals, joints: list[str]) -> LogResiduals:
    """Return the residuals of some driven joints only."""
    rows = [residuals.outputs.index(joint) for joint in joints]
    return replace(
        residuals,
        outputs=tuple(residuals.outputs[k] for k in rows),
        units=tuple(residuals.units[k] for k in rows),
        driven=len(rows),
        floor=residuals.floor[..., rows],
        runs=tuple(
            replace(run, before=run.before[:, rows], after=run.after[:, rows])
            for run in residuals.runs
        ),
    )


if __name__ == "__main__":
    reader = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    reader.add_argument("robot")
    reader.add_argument("fitted")
    reader.add_argument("log")
    reader.add_argument("picture", type=Path)
    reader.add_argument("--columns")
    reader.add_argument("--joints", nargs="+")
    main(reader.parse_args())
