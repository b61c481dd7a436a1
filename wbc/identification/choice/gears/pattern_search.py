"""Better numbers for gears that strike together, tried one by one: they follow no gradient far."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.effects.gear.yielding_gear import YieldingGear
from wbc.identification.model.columns.kept_columns import IMPOSSIBLE
from wbc.identification.model.derivatives import evaluate
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.records.record import Record
from wbc.robot import Effect, Parameter

FAR = (1.0, 0.7, 0.5, 0.35, 0.25)
"""Widths of the sweeps from a coarse grid."""
NEAR = (0.35, 0.25, 0.15)
"""Widths of the sweeps from a fit."""
_MOVES = (-1.0, -0.5, 0.5, 1.0)  # of one number in a sweep, as shares of ...
_SIZE, _SHAPE = 0.5, 1.4  # ... these logarithms for sizes (play) and shapes (flanks)
_LEAST = 0.1  # of its scale, that a number moves from


def pattern_search(
    problem: EstimationProblem,
    effects: Sequence[Effect],
    widths: Sequence[float],
    records: Sequence[Record],
) -> tuple[tuple[Effect, ...], float]:
    """Return the effects with the numbers of their gears moved to where less is left, and that.

    Every sweep moves one number of one gear after the other and keeps what leaves less.

    Args:
        problem: the logs.
        effects: where to begin.
        widths: of the sweeps.
        records: by which to judge.
    """

    def left(trial: Sequence[Effect]) -> float:
        try:
            return evaluate(problem.robot, trial, records, problem.whitening).cost
        except IMPOSSIBLE:
            return np.inf

    best = tuple(effects)
    least = left(best)
    gears = [k for k, effect in enumerate(best) if isinstance(effect, YieldingGear)]
    for width in widths:
        for k in gears:
            for parameter in best[k].parameters:
                for move in _MOVES:
                    value = _moved(best[k], parameter, width * move)
                    trial = (
                        *best[:k],
                        best[k].with_values({parameter.name: value}),
                        *best[k + 1 :],
                    )
                    cost = left(trial)
                    if cost < least:
                        best, least = trial, cost
    return best, least


def _moved(effect: Effect, parameter: Parameter, step: float) -> float:
    start = max(effect.values[parameter.name], _LEAST * parameter.scale)
    value = start * np.exp(step * (_SHAPE if parameter.shape else _SIZE))
    return float(np.clip(value, parameter.low, parameter.high))
