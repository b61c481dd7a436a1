"""In which order drive effects act: a limit before a sag clips another torque than one after it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from wbc.identification.choice.hypothesis import Model
from wbc.robot import Effect, Robot


def in_best_order(model: Model, fitted: Callable[[Sequence[Effect]], Model]) -> Model:
    """Return the model with its last drive effect where it leaves least.

    The order in which causes were found is no evidence of the order in which they act. Effects on
    other joints commute.

    Args:
        model: its other drive effects stand in order.
        fitted: returns the model fitted with some effects in the order given.
    """
    drives = [k for k, effect in enumerate(model.effects) if _drives(effect)]
    if not drives or drives[-1] != len(model.effects) - 1:
        return model
    *others, last = model.effects
    places = [k for k in drives[:-1] if _same_drive(others[k], last)]
    moved = [fitted((*others[:k], last, *others[k:])) for k in places]
    return min([model, *moved], key=lambda m: m.error)


def placed_first(
    model: Model, candidates: Sequence[type[Effect]], robot: Robot
) -> list[tuple[Effect, ...]]:
    """Return the effects of models in which one drive effect more acts before those there are.

    Beside a limit, what weakens a drive before it explains nothing where it acts behind it.

    Args:
        model: what one more is put to.
        candidates: effect classes that may be used.
        robot: without effects.
    """
    drives = [k for k, effect in enumerate(model.effects) if _drives(effect)]
    if not drives:
        return []
    taken = {(effect.name, effect.where) for effect in model.effects}
    offers = []
    for kind in candidates:
        if "drive" not in kind.acts_by:
            continue
        for where in kind.places(robot):
            if (kind.name, where) in taken:
                continue
            new = kind.at(where, kind.null_values(robot, where))
            k = next((k for k in drives if _same_drive(model.effects[k], new)), None)
            if k is not None:
                offers.append((*model.effects[:k], new, *model.effects[k:]))
    return offers


def _drives(effect: Effect) -> bool:
    return "drive" in effect.acts_by


def _same_drive(one: Effect, other: Effect) -> bool:
    """Whether both act on one motor; what acts on a joint is at its motor, the rest on all."""
    return one.where == other.where or "robot" in (one.where, other.where)
