"""How probable it is that a cause is there, and does not only stand in for one outside the list."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.choice.hypothesis import Hypothesis, Key, without
from wbc.identification.choice.odds import Odds
from wbc.identification.choice.trials import Trials

# Logistic regression on the generated corpus, see docs/data/corpus.md.
_LEVEL, _REMAINDER, _SHARE, _PLACES = -1.0, 1.0, 1.0, 3.0
_NONE = 1e-3  # of an error, that filters distort at least: no remainder is smaller


@dataclass(frozen=True)
class Support:
    """What speaks for one cause.

    Attributes:
        odds: summed probability of the hypotheses that hold it.
        group: the same of the hypotheses that hold it or what could stand in its place.
        remainder: what is left unexplained over what the cause explains (rms), at the outputs
            that it explains.
        share: what is left unexplained at these outputs, as a share of the first error (rms).
        places: at how many places the same effect was found.
    """

    odds: float
    group: float
    remainder: float
    share: float
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
        score = _LEVEL + _PLACES * (self.places - 1)
        score -= _REMAINDER * np.log(max(self.remainder, _NONE))
        score -= _SHARE * np.log(max(self.share, _NONE))
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
    first = trials.nothing.outputs
    result = {}
    for effect, rivals in zip(final.effects, odds.rivals(final), strict=True):
        smaller = trials.of(without(final.effects, effect))
        gain = np.zeros_like(excess) if smaller is None else smaller.outputs - final.outputs
        gain = np.maximum(gain, 0.0)
        result[effect.key] = Support(
            odds=odds.of(effect.key),
            group=odds.of_any((effect.key, *rivals)),
            remainder=_ratio(float(gain @ excess), float(gain @ gain)),
            share=_ratio(float(gain @ excess), float(gain @ first)),
            places=names.count(effect.name),
        )
    return result


def _ratio(left: float, beside: float) -> float:
    return float(np.sqrt(left / beside)) if beside > 0.0 else float(left > 0.0)
