"""How probable it is that a cause is there, and does not only stand in for one outside the list."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.choice.hypothesis import Hypothesis, Key, without
from wbc.identification.choice.odds import Odds
from wbc.identification.choice.trials import Trials

# Logistic regression on the generated corpus (seed 23, even numbers), see docs/data/corpus.md.
_LEVEL, _REMAINDER, _PLACES = -1.0, 2.0, 3.0


@dataclass(frozen=True)
class Support:
    """What speaks for one cause.

    Attributes:
        odds: summed probability of the hypotheses that hold it.
        group: the same of the hypotheses that hold it or what could stand in its place.
        remainder: what is left unexplained over what the cause explains (rms), at the outputs
            that it explains.
        places: at how many places the same effect was found.
    """

    odds: float
    group: float
    remainder: float
    places: int

    @property
    def probability(self) -> float:
        """That the cause is there: its odds among the list, and that it is no stand-in.

        What is outside the list can be approached by what is in it, and then leaves a remainder
        at the same outputs. One such cause does not imitate the same effect at several places.
        """
        return self.odds * self._no_stand_in

    @property
    def group_probability(self) -> float:
        """The same for the cause or one that these logs do not tell from it."""
        return self.group * self._no_stand_in

    @property
    def _no_stand_in(self) -> float:
        remainder = max(self.remainder, 1e-6)
        score = _LEVEL - _REMAINDER * np.log(remainder) + _PLACES * (self.places - 1)
        return float(1.0 / (1.0 + np.exp(-score)))


def support_of(
    trials: Trials, final: Hypothesis, odds: Odds, excess: FloatArray
) -> dict[Key, Support]:
    """Return what speaks for each cause of a hypothesis.

    Args:
        trials: of the search.
        final: the hypothesis.
        odds: of everything that was tried.
        excess: (outputs,) mean squares that are left unexplained, in floors.
    """
    names = [effect.name for effect in final.effects]
    result = {}
    for effect, rivals in zip(final.effects, odds.rivals(final), strict=True):
        smaller = trials.of(without(final.effects, effect))
        gain = np.zeros_like(excess) if smaller is None else smaller.outputs - final.outputs
        gain = np.maximum(gain, 0.0)
        total = float(gain.sum())
        share = gain / total if total > 0.0 else gain
        left = float(share @ excess)
        explained = float(share @ gain)
        remainder = float(np.sqrt(left / explained)) if explained > 0.0 else np.inf
        result[effect.key] = Support(
            odds.of(effect.key),
            odds.of_any((effect.key, *rivals)),
            remainder,
            names.count(effect.name),
        )
    return result
