"""What could stand in the place of a cause: exchanges after a greedy search."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.identification.credibility import credible
from wbc.identification.model import Model
from wbc.identification.selection import REFINED, SIMPLER, Selector, without
from wbc.robot import Effect

_EXCHANGES = 3


def settle(selector: Selector, model: Model, first: Model) -> tuple[Model, list[tuple[str, ...]]]:
    """Return the model after exchanges of single causes, and what could stand for each.

    What was added early was chosen without the rest: a rival that does better, or as well while
    it asks for less to be believed, takes its place. Rivals that do as well and are no more
    complicated remain as alternatives; order of addition is no evidence.

    Args:
        selector: with the candidates.
        model: found by the search.
        first: the model without causes.
    """
    current = model
    for _ in range(_EXCHANGES):
        rivals = [_rivals(selector, current, k) for k in range(len(current.effects))]
        better = _better(selector, [m for group in rivals for m in group], current, first)
        if better is None:
            break
        current = selector.prune(better, first)
    else:
        rivals = [_rivals(selector, current, k) for k in range(len(current.effects))]
    names = [
        _names([m for m in group if _stands(selector, m, current, effect, first)], effect)
        for group, effect in zip(rivals, current.effects, strict=True)
    ]
    return current, names


def _rivals(selector: Selector, model: Model, k: int) -> list[Model]:
    """Return models in which another cause stands in the place of number `k`."""
    own = model.effects[k]
    rest = selector.model(without(model.effects, k))
    found = selector.additions(rest, REFINED, [(own.name, own.where)], model.error)
    return [m for m in found if credible(selector.problem, m.fit)]


def _better(
    selector: Selector, rivals: Sequence[Model], current: Model, first: Model
) -> Model | None:
    simpler = [
        m
        for m in rivals
        if m.complexity < current.complexity - SIMPLER and not selector.pays(m, current, first)
    ]
    if simpler:
        return min(simpler, key=lambda m: (round(m.complexity, 6), m.error))
    stronger = [
        m
        for m in rivals
        if m.complexity < current.complexity + SIMPLER and selector.pays(current, m, first)
    ]
    return min(stronger, key=lambda m: m.error) if stronger else None


def _stands(selector: Selector, rival: Model, model: Model, own: Effect, first: Model) -> bool:
    """Whether the rival is as good, or leaves less though it asks for more to be believed.

    One name at two places is simpler than two names, but what has fewer numbers at this place is
    no less simple here.
    """
    fewer = rival.effects[-1].freedom < own.freedom and len(rival.effects) == len(model.effects)
    if rival.complexity < model.complexity + SIMPLER or fewer:
        return not selector.pays(rival, model, first)
    return selector.problem.leaning(model.squares, rival.squares)


def _names(rivals: Sequence[Model], own: Effect) -> tuple[str, ...]:
    """Return effect names; the same effect elsewhere is named `effect at place`."""
    names: dict[str, None] = {}
    for rival in rivals:
        other = rival.effects[-1]
        names[f"{other.name} at {other.where}" if other.name == own.name else other.name] = None
    return tuple(names)
