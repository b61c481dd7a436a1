"""Two gears that yield at once: alone, none of them explains what both do to one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from wbc.effects.gear.yielding_gear import YieldingGear
from wbc.identification.model.columns.kept_columns import IMPOSSIBLE
from wbc.identification.model.derivatives import evaluate
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.yielding import loose
from wbc.identification.records.record import Record
from wbc.robot import Effect
from wbc.transmission import Flanks

_PLAYS = (0.004, 0.006, 0.009, 0.014, 0.02, 0.03, 0.045)  # [rad] ...
_FLANK = 25.0  # ... between flanks on which the link swings at this frequency [Hz]
_SWINGS = (3.5, 7.0, 14.0)  # [Hz] behind springs
# Beside a spring that is known: on soft flanks a link strays least while its numbers are fitted.
# A knee with 15 mrad beside a soft hip was found from all of seven plays on flanks of 15 Hz, from
# four on 25 Hz, and from three on 40 Hz.
_BESIDE = 15.0  # [Hz]
_DAMPING = 0.15  # of the critical one, to begin with
_SOFTEST = 1.0  # [N m/rad], for the small links of a wrist
_JOINTS = 2  # at most, with the largest residuals: every pair of joints takes a second or two


class Pair(NamedTuple):
    """Two gears and the share of the error (mean square) that they leave."""

    effects: tuple[Effect, ...]
    share: float


def best_pairs(problem: EstimationProblem, classes: Sequence[type[Effect]]) -> list[Pair]:
    """Return two gears of a coarse grid, at least one of them loose, that leave least.

    One pair for every way in which two links may yield (loose or soft), best first.

    Empty where no two links of these logs could move behind their gears.

    Args:
        problem: the logs.
        classes: effects that may be used.
    """
    kinds = [kind for kind in classes if issubclass(kind, YieldingGear)]
    robot, records = problem.robot, loudest(problem)
    nothing = evaluate(robot, (), records, problem.whitening).cost
    best: dict[tuple[tuple[str, str], ...], Pair] = {}
    offers = [_gears(joint, records[0], kinds) for joint in _joints(problem)]
    for gears in combinations(offers, 2):
        for pair in product(*gears):
            if not loose(pair):
                continue
            try:
                share = evaluate(robot, pair, records, problem.whitening).cost / nothing
            except IMPOSSIBLE:
                continue
            way = tuple(gear.key for gear in pair)
            if way not in best or share < best[way].share:
                best[way] = Pair(pair, share)
    return sorted(best.values(), key=lambda pair: pair.share)


def loose_beside(
    problem: EstimationProblem, effects: Sequence[Effect], classes: Sequence[type[Effect]]
) -> list[tuple[Effect, ...]]:
    """Return effects with springs, each with one loose gear more at another joint.

    Two links that move behind their gears shake one another, so that no screen says what both
    leave: these are beginnings of fits, with every second play of the coarse grid.

    Args:
        problem: the logs.
        effects: with at least one spring.
        classes: effects that may be used.
    """
    kinds = [kind for kind in classes if issubclass(kind, YieldingGear) and kind.has_play]
    taken = {effect.where for effect in effects if isinstance(effect, YieldingGear)}
    free = [joint for joint in _joints(problem) if joint not in taken]
    record = loudest(problem)[0]
    return [
        (*effects, kind.having(joint, replace(flank, play=play)))
        for joint in free
        if (flank := _flank(joint, record, _BESIDE)) is not None
        for kind in kinds
        for play in _PLAYS[::2]
    ]


def loudest(problem: EstimationProblem) -> list[Record]:
    """Return the log with the largest residual, on which much can be tried in little time."""
    ends = np.cumsum([record.rows for record in problem.records])
    squares = np.split((problem.residual @ problem.whitening) ** 2, ends[:-1])
    return [problem.records[int(np.argmax([part.sum() for part in squares]))]]


def _joints(problem: EstimationProblem) -> list[str]:
    """Return the joints with the largest residuals, in their order."""
    squares = (problem.residual @ problem.whitening) ** 2
    transmission = problem.robot.transmission
    judged = [k for k in range(transmission.size) if k not in problem.floor.aside]
    order = np.argsort(-squares.mean(axis=0)[: len(judged)])
    return [transmission.joints[judged[k]] for k in sorted(order[:_JOINTS])]


def _gears(joint: str, record: Record, kinds: Sequence[type[YieldingGear]]) -> list[YieldingGear]:
    """Return the gears to try in front of a link: their flanks go by what it weighs."""
    flank = _flank(joint, record, _FLANK)
    if flank is None:
        return []
    swings = [spring for f in _SWINGS if (spring := _flank(joint, record, f)) is not None]
    bounces = [replace(flank, play=play) for play in _PLAYS]
    return [kind.having(joint, f) for kind in kinds for f in (bounces if kind.has_play else swings)]


def _flank(joint: str, record: Record, frequency: float) -> Flanks | None:
    """Return a spring behind which a link swings at a frequency [Hz], None without inertia."""
    response = record.response(joint)
    inertia = float(np.mean(response.inertia[:, response.row]))
    return _swinging(inertia, frequency) if inertia > 0.0 else None


def _swinging(inertia: float, frequency: float) -> Flanks:
    """Return a spring behind which an inertia [kg m^2] swings at a frequency [Hz]."""
    rate = 2.0 * np.pi * frequency
    stiffness = max(inertia * rate**2, _SOFTEST)
    return Flanks(float(stiffness), float(2.0 * _DAMPING * inertia * rate))
