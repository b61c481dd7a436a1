"""The order of the search: what acts at once, then links that swing behind their gears."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from wbc.identification.model import Model
from wbc.identification.problem import Problem
from wbc.identification.residual import deflects
from wbc.identification.selection import SIMPLER, Selector
from wbc.robot import Effect

_EXPLAINED = 1.3  # held-out mean square below which effects with a hidden state are not tried
_WORTHWHILE = 0.7  # of the error that a swinging link must promise to leave at most
_FILTERED = 0.01  # share of the first error that filters and derivatives distort
_SIMULATED = 0.1  # share of the first error to which links behind soft gears are simulated


def find_causes(
    problem: Problem, classes: Sequence[type[Effect]], report: Callable[[str], None]
) -> tuple[Selector, list[Model], Model]:
    """Return the search, its path and the model chosen.

    Effects with a hidden state are simulated, which is slow. They are tried where effects that act
    at once leave something: alone, since a swinging link looks like several other causes at
    once, and beside what was found; whatever acts at once is then sought anew.

    Args:
        problem: the logs.
        classes: effects that may be used.
        report: called with a line of text as the work proceeds.
    """
    everything = Selector(problem, tuple(classes), report)
    direct = replace(everything, candidates=tuple(c for c in classes if not deflects(c)))
    swinging = replace(everything, candidates=tuple(c for c in classes if deflects(c)))
    path = direct.run()
    first, final = path[0], direct.prune(path[-1], path[0])
    rough = _EXPLAINED + _SIMULATED**2 * first.error
    fine = _EXPLAINED + _FILTERED**2 * first.error
    # Simulated links are themselves off by a share; a lower bound calls for nothing finer.
    explained = fine if problem.floor.repeats else rough
    best = direct, path, final
    if not swinging.candidates:
        return best
    for start in dict.fromkeys((first, final)):
        if best[2].error < explained:
            break
        swings = swinging.best_addition(start, first, _WORTHWHILE * start.error)
        if swings is None:
            continue
        longer = direct.run([first, swings] if start is first else [*path, swings])
        found = direct.prune(longer[-1], first)
        if _better(direct, found, best[2], first):
            best = everything, longer, found
            explained = rough
    return best


def _better(judge: Selector, found: Model, known: Model, first: Model) -> bool:
    """Whether a model does better, or as well while it asks for less to be believed."""
    if judge.pays(known, found, first):
        return True
    return found.complexity < known.complexity - SIMPLER and not judge.pays(found, known, first)
