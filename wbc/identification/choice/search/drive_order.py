"""In which order drive effects act: a limit before a sag clips another torque than one after it."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.identification.choice.weighing.hypothesis import Hypothesis
from wbc.robot import Effect, Robot

Offer = tuple[Effect, ...]


def reordered(h: Hypothesis) -> list[Offer]:
    """Return the effects with the last drive effect before others that act on the same motor.

    The order in which causes were found is no evidence of the order in which they act. Effects on
    other joints commute.
    """
    drives = [k for k, effect in enumerate(h.effects) if _drives(effect)]
    if not drives or drives[-1] != len(h.effects) - 1:
        return []
    *others, last = h.effects
    places = [k for k in drives[:-1] if _same_drive(others[k], last)]
    return [(*others[:k], last, *others[k:]) for k in places]


def placed_first(h: Hypothesis, candidates: Sequence[type[Effect]], robot: Robot) -> list[Offer]:
    """Return the effects with one drive effect more that acts before those there are.

    Beside a limit, what weakens a drive before it explains nothing where it acts behind it.

    Args:
        h: what one more is put to.
        candidates: effect classes that may be used.
        robot: without effects.
    """
    drives = [k for k, effect in enumerate(h.effects) if _drives(effect)]
    if not drives:
        return []
    offers = []
    for kind in candidates:
        if "drive" not in kind.acts_by:
            continue
        for where in kind.places(robot):
            if (kind.name, where) in h.keys:
                continue
            new = kind.at(where, kind.null_values(robot, where))
            k = next((k for k in drives if _same_drive(h.effects[k], new)), None)
            if k is not None:
                offers.append((*h.effects[:k], new, *h.effects[k:]))
    return offers


def _drives(effect: Effect) -> bool:
    return "drive" in effect.acts_by


def _same_drive(one: Effect, other: Effect) -> bool:
    """Whether both act on one motor; what acts on a joint is at its motor, the rest on all."""
    return one.where == other.where or "robot" in (one.where, other.where)
