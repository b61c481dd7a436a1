"""Whether several causes together look like a basis in which another one was written down."""

from __future__ import annotations

import numpy as np

from wbc.identification.choice.hypothesis import Model
from wbc.identification.choice.selection import Selector
from wbc.robot import Effect

_LITTLE = 0.1  # share of the error that a cause must take away to count
_MOST_LITTLE = 1


def without_little_terms(selector: Selector, model: Model) -> Model:
    """Return the model without causes that take away less than a tenth of the error beside others.

    What is outside the list can be approached by ever more of what is in it, each of which gains
    little: a term of a series, not a cause. One such cause may be small; where there are more, all
    of them go. Judged in the order in which they gain most; one effect in several gears is one
    story. Links that swing are not judged.

    Args:
        selector: with the problem.
        model: found by the search.
    """
    groups = _stories(selector, model)
    if len(groups) <= _MOST_LITTLE + 1 or model.swings:
        return model
    present = kept = selector.model(())
    little = 0
    while groups:
        larger = {name: selector.model((*present.effects, *new)) for name, new in groups.items()}
        best = min(larger, key=lambda name: larger[name].error)
        small = np.sqrt(larger[best].error) > (1.0 - _LITTLE) * np.sqrt(present.error)
        little += small
        present = larger[best]
        kept = kept if small else selector.model((*kept.effects, *groups[best]))
        del groups[best]
    return kept if little > _MOST_LITTLE else model


def _stories(selector: Selector, model: Model) -> dict[tuple[str, str], list[Effect]]:
    joints = selector.problem.robot.transmission.joints
    groups: dict[tuple[str, str], list[Effect]] = {}
    for effect in model.effects:
        place = "" if effect.where in joints else effect.where
        groups.setdefault((effect.name, place), []).append(effect)
    return groups
