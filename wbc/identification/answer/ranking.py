"""What was found beside what was tried: paired differences on held-out data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from wbc.identification.choice.hypothesis import Model
from wbc.identification.choice.selection import Selector
from wbc.identification.records.folds import block_means

Key = tuple[str, str]
Standing = Literal["found", "better", "worse", "not distinguishable"]


@dataclass(frozen=True)
class Ranked:
    """A model that was tried, beside the one that was found.

    Attributes:
        added: (effect, where) of what it has and the model found has not.
        removed: (effect, where) of what it lacks.
        error: held-out root mean square in noise floors.
        difference: its held-out mean square minus that of the model found [floors^2].
        deviation: standard error of the difference; both models on the same blocks of the logs,
            a block being one observation.
        standing: `found` for the model found itself; `better` or `worse` than it by more than
            chance and filters explain, or `not distinguishable`.
    """

    added: tuple[Key, ...]
    removed: tuple[Key, ...]
    error: float
    difference: float
    deviation: float
    standing: Standing

    @property
    def text(self) -> str:
        """What the model is, in words."""
        if not self.added and not self.removed:
            return "what was found"
        if not self.added:
            return "robot as given" if len(self.removed) > 1 else f"without {_spoken(self.removed)}"
        if not self.removed:
            return f"with {_spoken(self.added)}, too"
        return f"{_spoken(self.added)} instead of {_spoken(self.removed)}"

    def to_json(self) -> dict[str, Any]:
        """Return plain texts and numbers."""
        return {
            "added": [{"effect": name, "where": where} for name, where in self.added],
            "removed": [{"effect": name, "where": where} for name, where in self.removed],
            "error": self.error,
            "difference": self.difference,
            "deviation": self.deviation,
            "standing": self.standing,
        }


def rank_models(selector: Selector, found: Model, given: Model) -> tuple[Ranked, ...]:
    """Return the models fitted on the way that differ from `found` in one cause, best first.

    One cause is an effect less, an effect more, or one in the place of another, at one place or in
    all gears; the robot as given is always among them. Nothing is fitted anew.

    Args:
        selector: whose fitted models are ranked.
        found: the model chosen.
        given: the robot without any effect added.
    """
    own = _keys(found)
    best: dict[frozenset[Key], Model] = {}
    for model in (*selector.fitted, given):
        keys = frozenset(_keys(model))
        less, more = set(own) - keys, {name for name, _ in keys - set(own)}
        near = len(less) <= 1 and len(more) <= 1
        if (near or not keys) and (keys not in best or model.error < best[keys].error):
            best[keys] = model
    best[frozenset(own)] = found
    rows = [_beside(selector, model, found, given) for model in best.values()]
    return tuple(sorted(rows, key=lambda row: row.difference))


def _beside(selector: Selector, model: Model, found: Model, given: Model) -> Ranked:
    own, keys = _keys(found), _keys(model)
    blocks = block_means((model.squares - found.squares).mean(axis=1), selector.problem.blocks)
    return Ranked(
        added=tuple(key for key in keys if key not in own),
        removed=tuple(key for key in own if key not in keys),
        error=float(np.sqrt(model.error)),
        difference=model.error - found.error,
        deviation=float(np.std(blocks, ddof=1) / np.sqrt(blocks.size)),
        standing=_standing(selector, model, found, given),
    )


def _standing(selector: Selector, model: Model, found: Model, given: Model) -> Standing:
    if model is found:
        return "found"
    if selector.pays(model, found, given):
        return "worse"
    return "better" if selector.pays(found, model, given) else "not distinguishable"


def _spoken(keys: tuple[Key, ...]) -> str:
    return " and ".join(f"{name.replace('_', ' ')} at {where}" for name, where in keys)


def _keys(model: Model) -> tuple[Key, ...]:
    return tuple((effect.name, effect.where) for effect in model.effects)
