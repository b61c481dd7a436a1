"""Intervals of a link's inertia after a random, a D-optimal and a designed motion of 10 s.

    python -m benchmarks.experiment_intervals

Half widths of the 90 % intervals that each motion is expected to leave, all within the same limits.
Each number of the link is held against itself: its width over its median width after 15 random
motions, so that masses and lengths are not mixed. Printed are the geometric mean and the median of
these shares over the numbers that a motion shows at all, and each of them, for the leg and a
six-axis arm. The planner makes the geometric mean small. The D-optimal motion informs about
the inertia of every link, as identification usually asks, and is found by changes at random alone;
the designed one informs about the link in question.
"""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Callable
from functools import partial
from importlib.metadata import version

import numpy as np

from wbc.design.experiment import (
    Cause,
    Designed,
    FourierPath,
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

LINKS = (
    ("planar_leg_fixed", "shin", 6.0),
    ("staubli_tx40", "link_3", 3.0),
    ("staubli_tx40", "link_4", 3.0),
)
"""Robot, link and the limit of joint speeds [rad/s]."""
_DURATION, _RANDOM, _ROUNDS = 10.0, 15, 300  # rounds: as `wbc experiment`
_NOISE = 0.01  # of the largest torque that holding still asks for: a good torque sensor


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", metavar="LINK", help="shin, link_3 or link_4; default all")
    parser.add_argument(
        "--climb-d-optimal", action="store_true", help="also climb the D-optimal motion: minutes"
    )
    options = parser.parse_args()
    print(f"python {platform.python_version()}, numpy {version('numpy')}, {platform.machine()}")
    for name, body, speed in LINKS:
        if options.only in (None, body):
            robot = load_robot(name).lossless()
            report(robot, body, speed, options.seed, options.climb_d_optimal)


def report(
    robot: Robot, body: str, speed: float, seed: int, climb_classic: bool = False
) -> dict[str, float]:
    """Print the widths over those of a random motion, and return their geometric means."""
    limits = MotionLimits.of(robot, 1.0, speed, 10.0 * speed)
    noise = np.full(robot.transmission.size, _NOISE * _largest_torque(robot))
    ours = Rivals(robot, (link_cause(robot, body),), noise)
    links = sum((link_cause(robot, one) for one in _bodies(robot)), ())
    every = Rivals(robot, (links,), noise)
    drawn = [
        expected(ours, limits, path).widths[0]
        for path in random_paths(ours, limits, _DURATION, seed + 1, _RANDOM)
    ]
    chance = np.median(drawn, axis=0)
    plan = partial(design_experiment, limits=limits, duration=_DURATION, seed=seed, rounds=_ROUNDS)
    classic, spent = _timed(partial(plan, every, aim=informing, climb=False))
    plans = {
        "designed, no climb": partial(plan, ours, aim=shrinking, starts=[classic], climb=False),
        "designed": partial(plan, ours, aim=shrinking, starts=[classic]),
    }
    if climb_classic:
        plans["D-optimal, climbed"] = partial(plan, every, aim=informing)
    paths = {"D-optimal, all links": (classic, spent)}
    paths |= {name: _timed(one) for name, one in plans.items()}
    widths = {name: expected(ours, limits, path).widths[0] for name, (path, _) in paths.items()}
    before = np.array([1.645 * p.scale for _, p in parameter_names(ours.causes[0])])
    shown = widths["designed"] < 0.5 * before
    best = min(drawn, key=lambda one: _mean((one / chance)[shown]))
    shares = {"random, best of 15": (best / chance)[shown]}
    shares |= {name: (one / chance)[shown] for name, one in widths.items()}
    print(
        f"\n{robot.name}, inertia of {body}, seed {seed}: {int(shown.sum())} of {len(shown)} "
        "numbers show; widths over those after a random motion"
    )
    print(f"  {'':22s} mean  median  CPU s  each")
    for name, each in shares.items():
        listed = ", ".join(f"{share:.2f}" for share in each)
        cost = f"{paths[name][1]:5.0f}" if name in paths else " " * 5
        print(
            f"  {name:22s} {_mean(each):4.2f}  {np.median(each):6.2f}  {cost}  {listed}", flush=True
        )
    return {name: _mean(each) for name, each in shares.items()}


def _timed(plan: Callable[[], Designed]) -> tuple[FourierPath, float]:
    """Return a planned path, and the processor time [s] that planning took."""
    start = time.process_time()
    return plan().path, time.process_time() - start


def _mean(shares: np.ndarray) -> float:
    """Return the geometric mean."""
    return float(np.exp(np.mean(np.log(shares))))


def link_cause(robot: Robot, body: str) -> Cause:
    """Return the inertia of a link as a cause."""
    return parse_cause(f"center_of_mass@{body}+payload_mass@{body}", robot)


def _bodies(robot: Robot) -> list[str]:
    return [b for b in robot.bodies if robot.model.inertias[robot.body_joint(b)].mass > 0.0]


def _largest_torque(robot: Robot) -> float:
    """Return the rotor torque [N m] that holds the robot's weight with its links stretched out."""
    mass = sum(inertia.mass for inertia in robot.model.inertias)
    reach = sum(float(np.linalg.norm(p.translation)) for p in robot.model.jointPlacements)
    return float(mass * 9.81 * 0.5 * reach / np.abs(robot.transmission.gear_ratio).mean())


if __name__ == "__main__":
    main()
