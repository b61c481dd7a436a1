"""The runs that may follow a tied diagnosis: words, a random, a D-optimal and a designed motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.excitation import Excitation, PlannedExcitation
from wbc.arrays import FloatArray
from wbc.design.experiment import (
    Cause,
    Designed,
    MotionLimits,
    Pair,
    Predictions,
    Rivals,
    deciding,
    design_experiment,
    expected,
    informing,
    random_paths,
)
from wbc.robot import Robot

DURATION = 10.0  # [s] of one planned run
ROUNDS = 480  # changes tried: CPU time bounds this study, `wbc experiment` tries 2400
WORDS, RANDOM, CLASSIC, DESIGNED = "advice in words", "random", "D-optimal", "designed"
ARMS = (WORDS, RANDOM, CLASSIC, DESIGNED)
# The corpus' own runs stay within these: strokes of 1 rad, 6 rad/s, 60 rad/s^2 (shaking).
_SPAN, _SPEED, _ACCELERATION = 1.0, 6.0, 60.0


def planned_runs(
    case: Case, rivals: Rivals, duration: float = DURATION
) -> tuple[dict[str, tuple[Excitation, ...]], dict[str, Designed]]:
    """Return the runs of a random, a D-optimal and a designed motion, and what is said of them.

    All of the same length and within the same limits.

    Raises:
        DesignError: no motion tells these causes apart.
    """
    limits, settings = _task(case, rivals.robot)
    rate, seed = settings["rate"], settings["seed"]
    chance = next(random_paths(rivals, limits, duration, seed + 1, 1))
    classic = design_experiment(rivals, limits, duration, aim=informing, **settings)
    ours = design_experiment(rivals, limits, duration, starts=[classic.path], **settings)
    said = {RANDOM: expected(rivals, limits, chance, rate), CLASSIC: classic, DESIGNED: ours}
    first, time, runs = 2_000_000 + 100 * case.number, PlannedExcitation.times(duration), {}
    for k, (name, one) in enumerate(said.items()):
        q = one.path.at(time)[0]
        runs[name] = (PlannedExcitation("planned", first + k, duration, first + k, 0.0, q),)
    return runs, said


def noise_of(case: Case) -> FloatArray:
    """Return (m,) the noise of the measured rotor torques [N m]."""
    return np.asarray(case.torque_noise / np.abs(case.machine.ratio))


def _task(case: Case, robot: Robot) -> tuple[MotionLimits, dict[str, Any]]:
    limits = MotionLimits.of(robot, _SPAN, _SPEED, _ACCELERATION, case.machine.center)
    rate = min(case.sensors.rate, 100.0)
    settings = {"rate": rate, "rounds": ROUNDS, "seed": case.number}
    return limits, settings


def attainable(
    case: Case, robot: Robot, true: Cause, rival: Cause, said: Mapping[str, Designed]
) -> float:
    """Return the nats that the best motion for two causes alone is expected to bring the true one.

    Designed for the true values, from all planned motions: no plan can know these.
    """
    rivals = Rivals(robot, (true, rival), noise_of(case))
    limits, settings = _task(case, robot)

    def aim(found: Predictions, pairs: Sequence[Pair]) -> float:
        return deciding(found, [(0, 1)])  # for the first cause, as it truly is

    starts = [one.path for one in said.values()]
    duration = starts[0].duration
    best = design_experiment(rivals, limits, duration, aim=aim, starts=starts, **settings)
    return float(best.odds[0, 1])
