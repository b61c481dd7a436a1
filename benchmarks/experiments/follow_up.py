"""The runs that may follow a tied diagnosis: words, a random, a D-optimal and a designed motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.excitation import Excitation, PlannedExcitation
from benchmarks.corpus.experiments import following_runs
from wbc.design.experiment import (
    FourierPath,
    MotionLimits,
    Rivals,
    design_experiment,
    informing,
    random_paths,
    tied_causes,
)
from wbc.errors import DesignError
from wbc.identification import Diagnosis
from wbc.robot import Robot

DURATION = 10.0  # [s] of one planned run
ROUNDS = 60  # changes tried: CPU time bounds this study, `wbc experiment` tries 300
WORDS, RANDOM, CLASSIC, DESIGNED = "advice in words", "random", "D-optimal", "designed"
ARMS = (WORDS, RANDOM, CLASSIC, DESIGNED)
# The corpus' own runs stay within these: strokes of 1 rad, 6 rad/s, 60 rad/s^2 (shaking).
_SPAN, _SPEED, _ACCELERATION = 1.0, 6.0, 60.0


def follow_ups(
    case: Case, robot: Robot, diagnosis: Diagnosis
) -> tuple[dict[str, tuple[Excitation, ...]], str]:
    """Return the runs of every arm, and why there are no planned ones where there are none."""
    arms = {WORDS: following_runs(case, diagnosis)}
    try:
        paths = _planned(case, robot, diagnosis)
    except DesignError as reason:
        return arms, str(reason)
    first = 2_000_000 + 100 * case.number
    time = PlannedExcitation.times(DURATION)
    for k, (name, path) in enumerate(paths.items()):
        positions = path.at(time)[0]
        arms[name] = (PlannedExcitation("planned", first + k, DURATION, first + k, 0.0, positions),)
    return arms, ""


def _planned(case: Case, robot: Robot, diagnosis: Diagnosis) -> Mapping[str, FourierPath]:
    """Return one motion per arm, all of the same length and within the same limits."""
    noise = np.asarray(case.torque_noise / np.abs(case.machine.ratio))
    rivals = Rivals(robot, tied_causes(diagnosis.to_json(), robot), noise)
    limits = MotionLimits.of(robot, _SPAN, _SPEED, _ACCELERATION, case.machine.centre)
    rate, seed = case.sensors.rate, case.number
    chance = next(random_paths(rivals, limits, DURATION, seed + 1, 1))
    settings = {"rate": min(rate, 100.0), "rounds": ROUNDS, "seed": seed}
    classic = design_experiment(rivals, limits, DURATION, aim=informing, **settings)
    ours = design_experiment(rivals, limits, DURATION, starts=[classic.path], **settings)
    return {RANDOM: chance, CLASSIC: classic.path, DESIGNED: ours.path}
