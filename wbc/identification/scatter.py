"""Better numbers for gears that strike together, by chance: such links follow no gradient."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.effects.yielding_gear import YieldingGear
from wbc.identification.derivatives import evaluate
from wbc.identification.kept_columns import IMPOSSIBLE
from wbc.identification.problem import Problem
from wbc.robot import Effect

_WIDTHS = (1.0, 0.7, 0.5, 0.3, 0.2)  # of the rounds
_TRIALS = 12  # per round
_SIZE, _SHAPE = 0.15, 0.7  # logarithm by which sizes (play) and shapes (flanks) are moved
_LEAST = 0.1  # of its scale, that a number moves from


def scattered(problem: Problem, effects: Sequence[Effect], seed: int) -> tuple[Effect, ...]:
    """Return the effects with the numbers of their gears moved to where less is left.

    Gears found one after the other carry in their numbers what the others were not yet there for.

    Args:
        problem: the logs.
        effects: as fitted.
        seed: of what is drawn.
    """
    random = np.random.default_rng(seed)
    best = tuple(effects)
    least = evaluate(problem.robot, best, problem.records, problem.whitening).cost
    for width in _WIDTHS:
        for _ in range(_TRIALS):
            moved = tuple(_moved(effect, width, random) for effect in best)
            try:
                cost = evaluate(problem.robot, moved, problem.records, problem.whitening).cost
            except IMPOSSIBLE:
                continue
            if cost < least:
                best, least = moved, cost
    return best


def _moved(effect: Effect, width: float, random: np.random.Generator) -> Effect:
    if not isinstance(effect, YieldingGear):
        return effect
    values = {}
    for parameter in effect.parameters:
        spread = width * (_SHAPE if parameter.shape else _SIZE)
        start = max(effect.values[parameter.name], _LEAST * parameter.scale)
        value = start * float(np.exp(spread * random.standard_normal()))
        values[parameter.name] = float(np.clip(value, parameter.low, parameter.high))
    return effect.with_values(values)
