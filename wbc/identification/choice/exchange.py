"""What could stand in the place of a cause: exchanges after a greedy search."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.identification.choice.candidate_columns import Shelf
from wbc.identification.choice.credibility import credible, shape_at_bound, showing
from wbc.identification.choice.hypothesis import Model, least_complexity
from wbc.identification.choice.merging import merged
from wbc.identification.choice.selection import REFINED, SIMPLER, Selector, without
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect

_EXCHANGES = 3
_LOST = 1.2  # mean square over that of the search's model, above which an exchange loses a cause
_SAME = 0.005  # share of what a cause explains, that a rival of the same shape may miss


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
    for left in reversed(range(_EXCHANGES + 1)):
        offers = _all_offers(selector, current)
        # What asks for more to be believed takes no place: it is only fitted at the end.
        bound = current.complexity + SIMPLER
        whole = [_offers_for_all(selector, current, name) for name in _repeated(current)]
        simple = [e for group in (*offers, *whole) for e in group if least_complexity(e) < bound]
        rivals = _credible(selector, simple) if left else []
        # Losses too small to count one by one would add up from exchange to exchange.
        kept = [m for m in rivals if not selector.pays(m, model, first)]
        better = _better(selector, kept, current, first)
        if better is None and left:
            better = merged(selector, current, first)
        if better is None:
            break
        pruned = selector.prune(better, first)
        # A tenth of the error (rms), lost by way of an equal, was found by chance.
        if selector.pays(pruned, model, first) and pruned.error > _LOST * model.error:
            break
        current = pruned
    names = [
        _names(
            [m for m in _credible(selector, group) if _stands(selector, m, current, k, first)],
            current.effects[k],
        )
        for k, group in enumerate(offers)
    ]
    return current, names


def _all_offers(selector: Selector, model: Model) -> list[list[tuple[Effect, ...]]]:
    """Return for each cause the effects of the models in which another one stands in its place.

    What a small effect adds to the model hardly depends on one cause more or less: all
    screens but those beside a link that swings share the columns of the whole model.
    """
    columns: Shelf = {}
    return [_offers(selector, model, k, columns) for k in range(len(model.effects))]


def _offers(selector: Selector, model: Model, k: int, columns: Shelf) -> list[tuple[Effect, ...]]:
    own = model.effects[k]
    near = None if deflects(own) else (model.fit.robot, columns)
    if not deflects(own) and model.swings:
        # One swinging link more was sought already where it was found.
        selector = selector.at_once
    rest = selector.model(without(model.effects, k))
    return selector.promising(rest, REFINED, [(own.name, own.where)], model.error, near=near)


def _repeated(model: Model) -> list[str]:
    """Return the names that stand at several places."""
    names = [effect.name for effect in model.effects]
    return [name for name in dict.fromkeys(names) if names.count(name) > 1]


def _offers_for_all(selector: Selector, model: Model, name: str) -> list[tuple[Effect, ...]]:
    """Return the effects of models in which others stand for one effect at all its places.

    One by one they could not be exchanged: every rival would be one more name to believe in.
    """
    own = [e for e in model.effects if e.name == name]
    places = {e.where for e in own}
    rest = selector.model([e for e in model.effects if e.name != name])
    elsewhere = [
        (c.name, joint)
        for c in selector.candidates
        for joint in rest.fit.robot.transmission.joints
        if joint not in places
    ]
    aside = [(name, place) for place in places] + elsewhere
    return selector.promising(rest, REFINED, aside, model.error)


def _credible(selector: Selector, offers: Sequence[tuple[Effect, ...]]) -> list[Model]:
    """Return the models with these effects that are an explanation at all."""
    fitted = [selector.model(effects) for effects in offers]
    return [m for m in fitted if credible(selector.problem, m.fit)]


def _better(
    selector: Selector, rivals: Sequence[Model], current: Model, first: Model
) -> Model | None:
    simpler = [m for m in rivals if _simpler(m, current) and not selector.pays(m, current, first)]
    if simpler:
        return min(simpler, key=lambda m: (round(m.complexity, 6), m.numbers, m.error))
    stronger = [
        m
        for m in rivals
        if m.complexity < current.complexity + SIMPLER and selector.pays(current, m, first)
    ]
    return min(stronger, key=lambda m: m.error) if stronger else None


def _simpler(rival: Model, model: Model) -> bool:
    """Whether a rival asks for less to be believed, or for the same while less of it was fitted.

    Two efficiencies near the relation of a wedge count as one number, but two were fitted.
    """
    if rival.complexity < model.complexity - SIMPLER:
        return True
    return rival.complexity < model.complexity + SIMPLER and rival.numbers < model.numbers


def _stands(selector: Selector, rival: Model, model: Model, k: int, first: Model) -> bool:
    """Whether a rival of cause `k` is as good for no more, or the same although it asks for more.

    What asks for more to be believed must explain the same to a small share, and show in the logs
    by numbers of its own: a spring far from its rest is only an offset.
    """
    others = without(model.effects, k)
    if rival.complexity < model.complexity + SIMPLER:
        return not selector.pays(rival, model, first)
    problem = selector.problem
    explained = selector.model(others).error - model.error
    if len(rival.effects) > len(model.effects) or shape_at_bound(rival.fit):
        return False
    if rival.error - model.error > _SAME * explained:
        return False
    if problem.leaning(rival.squares, model.squares):
        return False
    return showing(problem, rival.fit) >= set(range(len(others), len(rival.effects)))


def _names(rivals: Sequence[Model], own: Effect) -> tuple[str, ...]:
    """Return effect names; the same effect elsewhere is named `effect at place`."""
    names: dict[str, None] = {}
    for rival in rivals:
        other = rival.effects[-1]
        names[f"{other.name} at {other.where}" if other.name == own.name else other.name] = None
    return tuple(names)
