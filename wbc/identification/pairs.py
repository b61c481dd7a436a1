"""Two gears that yield at once: alone, none of them explains what both do to one another."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from wbc.effects import Backlash, JointCompliance
from wbc.effects.yielding_gear import YieldingGear
from wbc.identification.derivatives import evaluate
from wbc.identification.kept_columns import IMPOSSIBLE
from wbc.identification.problem import Problem
from wbc.identification.record import Record
from wbc.identification.swinging import strike_together
from wbc.robot import Effect

_JOINTS = 3  # at most, with the largest residuals
_PLAYS = (0.004, 0.006, 0.009, 0.014, 0.02, 0.03, 0.045)  # [rad]
_FLANK = 25.0  # [Hz] at which a link swings on a flank
_SPRINGS = (3.5, 7.0, 14.0)  # [Hz] at which a link swings behind a soft gear
_SOFTEST = 1.0  # [N m/rad]
_DAMPING = 0.15  # of the critical one


class Pair(NamedTuple):
    """Two gears and the share of the error (mean square) that they leave."""

    effects: tuple[Effect, ...]
    share: float


def best_pairs(problem: Problem, classes: Collection[type[Effect]]) -> list[Pair]:
    """Return two gears of a coarse grid, at least one of them loose, that leave least.

    One pair for every way in which two links may yield (loose or soft), best first.

    Empty where no two links of these logs could move behind their gears.

    Args:
        problem: the logs.
        classes: effects that may be used.
    """
    if not {Backlash, JointCompliance} <= set(classes):
        return []
    robot, records = problem.robot, loudest(problem)
    squares = (problem.residual @ problem.whitening) ** 2
    own = squares.mean(axis=0)[: robot.transmission.size]
    joints = [robot.transmission.joints[k] for k in sorted(np.argsort(-own)[:_JOINTS])]
    nothing = evaluate(robot, (), records, problem.whitening).cost
    best: dict[tuple[tuple[str, str], ...], Pair] = {}
    for one, other in combinations(joints, 2):
        for pair in product(_gears(one, records[0]), _gears(other, records[0])):
            if not strike_together(pair):
                continue
            try:
                share = evaluate(robot, pair, records, problem.whitening).cost / nothing
            except IMPOSSIBLE:
                continue
            way = tuple(gear.key for gear in pair)
            if way not in best or share < best[way].share:
                best[way] = Pair(pair, share)
    return sorted(best.values(), key=lambda pair: pair.share)


def loudest(problem: Problem) -> list[Record]:
    """Return the log with the largest residual, on which much can be tried in little time."""
    ends = np.cumsum([record.rows for record in problem.records])
    squares = np.split((problem.residual @ problem.whitening) ** 2, ends[:-1])
    return [problem.records[int(np.argmax([part.sum() for part in squares]))]]


def _gears(joint: str, record: Record) -> Iterator[YieldingGear]:
    """Yield the gears to try in front of a link: their flanks go by what it weighs."""
    response = record.response(joint)
    inertia = float(np.mean(response.inertia[:, response.row]))
    if inertia <= 0.0:
        return

    def flank(frequency: float) -> tuple[float, float]:
        rate = 2.0 * np.pi * frequency
        return max(inertia * rate**2, _SOFTEST), 2.0 * _DAMPING * inertia * rate

    for play in _PLAYS:
        yield Backlash(joint, play, *flank(_FLANK))
    for frequency in _SPRINGS:
        yield JointCompliance(joint, *flank(frequency))
