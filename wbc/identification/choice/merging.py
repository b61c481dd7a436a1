"""Several causes that one other explains: what imitates it in parts gives way to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, combinations, islice

from wbc.identification.choice.candidate_columns import Shelf
from wbc.identification.choice.credibility import credible, showing
from wbc.identification.choice.hypothesis import Model, least_complexity
from wbc.identification.choice.selection import SIMPLER, Selector
from wbc.robot import Effect

_GROUPS = 8  # of causes that are tried, so that a long list costs no more than a short one
_TRIED = 2  # effects in the place of each group
_LARGEST = 3  # names that one may replace


def merged(selector: Selector, model: Model, first: Model) -> Model | None:
    """Return the simplest model in which one effect stands for two or three names, or None.

    Exchanged one by one none of them would give way: without the others the one effect explains
    too much. It must do as well, and leave no more than chance does.

    Args:
        selector: with the candidates.
        model: none of its causes can be exchanged.
        first: the model without causes.
    """
    if model.swings:
        return None
    # One swinging link was sought already where it was found.
    selector = selector.at_once
    taken = [e.key for e in model.effects]
    columns: Shelf = {}
    near = model.fit.robot, columns
    found = []
    for group in islice(_groups(model.effects), _GROUPS):
        rest = selector.model([e for e in model.effects if e not in group])
        offers = selector.promising(rest, _TRIED, taken, model.error, near=near)
        simpler = [e for e in offers if least_complexity(e) < model.complexity - SIMPLER]
        found += [selector.model(effects) for effects in simpler]
    good = [m for m in found if _does_as_well(selector, m, model, first)]
    return min(good, key=lambda m: (round(m.complexity, 6), m.error), default=None)


def _groups(effects: Sequence[Effect]) -> Iterator[tuple[Effect, ...]]:
    """Yield the effects of two, then of three names, what was added last first."""
    names = list(dict.fromkeys(effect.name for effect in reversed(effects)))
    sizes = (combinations(names, size) for size in range(2, _LARGEST + 1))
    for chosen in chain.from_iterable(sizes):
        yield tuple(effect for effect in effects if effect.name in chosen)


def _does_as_well(selector: Selector, rival: Model, model: Model, first: Model) -> bool:
    return (
        rival.complexity < model.complexity - SIMPLER
        and not selector.pays(rival, model, first)
        and not selector.problem.leaning(rival.squares, model.squares)
        and credible(selector.problem, rival.fit)
        and len(showing(selector.problem, rival.fit)) == len(rival.effects)
    )
