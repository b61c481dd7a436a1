"""Intervals of a link's inertia after a random, a D-optimal and a designed motion of 10 s.

    python -m benchmarks.experiment_intervals

Half widths of the 90 % intervals that each motion is expected to leave, all within the same limits:
the median over the numbers of the link that a motion shows at all, for the leg and a six-axis arm.
The D-optimal motion informs about the inertia of every link, as identification usually asks; the
designed one about the link in question.
"""

from __future__ import annotations

import platform
import time
from importlib.metadata import version

import numpy as np

from wbc.design.experiment import (
    Cause,
    Designed,
    MotionLimits,
    Rivals,
    design_experiment,
    expected,
    informing,
    parameter_names,
    parse_cause,
    random_paths,
    shrinking,
)
from wbc.effects import load_robot
from wbc.robot import Robot

_DURATION, _RANDOM, _ROUNDS = 10.0, 15, 300  # rounds: as `wbc experiment`
_NOISE = 0.01  # of the largest torque that holding still asks for: a good torque sensor


def main() -> None:
    print(f"python {platform.python_version()}, numpy {version('numpy')}, {platform.machine()}")
    leg = load_robot("planar_leg_fixed").lossless()
    arm = load_robot("staubli_tx40")
    report(leg, "shin", 1.0, 6.0)
    report(arm, "link_3", 1.0, 3.0)
    report(arm, "link_4", 1.0, 3.0)


def report(robot: Robot, body: str, span: float, speed: float) -> dict[str, float]:
    """Print and return the median widths over that of a random motion."""
    start = time.process_time()
    limits = MotionLimits.of(robot, span, speed, 10.0 * speed)
    noise = np.full(robot.transmission.size, _NOISE * _largest_torque(robot))
    ours = Rivals(robot, (link_cause(robot, body),), noise)
    links = sum((link_cause(robot, one) for one in _bodies(robot)), ())
    every = Rivals(robot, (links,), noise)
    drawn = [expected(ours, limits, p) for p in random_paths(ours, limits, _DURATION, 1, _RANDOM)]
    classic = design_experiment(every, limits, _DURATION, rounds=_ROUNDS, aim=informing)
    told = expected(ours, limits, classic.path)
    found = design_experiment(
        ours, limits, _DURATION, rounds=_ROUNDS, aim=shrinking, starts=[classic.path]
    )
    before = np.array([1.645 * p.scale for _, p in parameter_names(ours.causes[0])])
    shown = found.widths[0] < 0.5 * before
    chance = float(np.median([_median(one, shown) for one in drawn]))
    ratios = {
        "random, median": 1.0,
        "random, best of 15": min(_median(one, shown) for one in drawn) / chance,
        "D-optimal, all links": _median(told, shown) / chance,
        "designed": _median(found, shown) / chance,
    }
    print(f"\n{robot.name}, inertia of {body}: {int(shown.sum())} of {len(shown)} numbers show")
    for name, ratio in ratios.items():
        print(f"  {name:22s} {ratio:6.2f} of the width after a random motion")
    print(f"  {time.process_time() - start:.0f} CPU s")
    return ratios


def link_cause(robot: Robot, body: str) -> Cause:
    """Return the inertia of a link as a cause."""
    return parse_cause(f"center_of_mass@{body}+payload_mass@{body}", robot)


def _median(one: Designed, shown: np.ndarray) -> float:
    return float(np.median(one.widths[0][shown]))


def _bodies(robot: Robot) -> list[str]:
    return [b for b in robot.bodies if robot.model.inertias[robot.body_joint(b)].mass > 0.0]


def _largest_torque(robot: Robot) -> float:
    """Return the rotor torque [N m] that holds the robot's weight with its links stretched out."""
    mass = sum(inertia.mass for inertia in robot.model.inertias)
    reach = sum(float(np.linalg.norm(p.translation)) for p in robot.model.jointPlacements)
    return float(mass * 9.81 * 0.5 * reach / np.abs(robot.transmission.gear_ratio).mean())


if __name__ == "__main__":
    main()
