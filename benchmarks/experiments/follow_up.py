"""The runs that may follow a tied diagnosis: words, a random, a D-optimal and a designed motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.excitation import Excitation, PlannedExcitation
from benchmarks.corpus.experiments import following_runs
from wbc.design.experiment import (
    Cause,
    Designed,
    MotionLimits,
    Rivals,
    design_experiment,
    expected,
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
        runs, _ = planned_runs(case, robot, tied_causes(diagnosis.to_json(), robot))
    except DesignError as reason:
        return arms, str(reason)
    return {**arms, **runs}, ""


def planned_runs(
    case: Case, robot: Robot, causes: Sequence[Cause]
) -> tuple[dict[str, tuple[Excitation, ...]], dict[str, Designed]]:
    """Return the runs of a random, a D-optimal and a designed motion, and what is said of them.

    All of the same length and within the same limits.

    Raises:
        DesignError: no motion tells these causes apart.
    """
    noise = np.asarray(case.torque_noise / np.abs(case.machine.ratio))
    rivals = Rivals(robot, tuple(causes), noise)
    limits = MotionLimits.of(robot, _SPAN, _SPEED, _ACCELERATION, case.machine.centre)
    rate, seed = min(case.sensors.rate, 100.0), case.number
    chance = next(random_paths(rivals, limits, DURATION, seed + 1, 1))
    settings = {"rate": rate, "rounds": ROUNDS, "seed": seed}
    classic = design_experiment(rivals, limits, DURATION, aim=informing, **settings)
    ours = design_experiment(rivals, limits, DURATION, starts=[classic.path], **settings)
    said = {RANDOM: expected(rivals, limits, chance, rate), CLASSIC: classic, DESIGNED: ours}
    first, time, runs = 2_000_000 + 100 * case.number, PlannedExcitation.times(DURATION), {}
    for k, (name, one) in enumerate(said.items()):
        q = one.path.at(time)[0]
        runs[name] = (PlannedExcitation("planned", first + k, DURATION, first + k, 0.0, q),)
    return runs, said
