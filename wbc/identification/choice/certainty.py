"""How probable it is that a cause is there, and does not only stand in for one outside the list."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.choice.hypothesis import Hypothesis, Key, without
from wbc.identification.choice.odds import Odds
from wbc.identification.choice.trials import Trials

# Logistic regression on 318 causes found in the generated corpus, 250 of them true; see
# docs/measurements/data/corpus.md. Of those with a probability of 0.95 or more 95 % were true.
# Fits to other selections of the cases give 0.58 to 0.9 for the slope of the remainder.
_LEVEL, _REMAINDER, _COVERAGE, _EXPLAINED = -0.44, 0.8, 1.59, 2.02
_NONE = 1e-3  # of what a cause explains, that filters distort at least: no remainder is smaller


@dataclass(frozen=True)
class Support:
    """What speaks for one cause.

    Attributes:
        odds: summed probability of the hypotheses that hold it.
        group: the same of the hypotheses that hold it or what could stand in its place.
        remainder: what is left above the floor over what the cause explains (rms), at the outputs
            that it explains.
        coverage: (k - 1) k / n where the same effect was found at k of n joints.
        explained: whether too little is left altogether to ask for one cause more.
        expected: log prior odds of the effect on real machines [nats] (`Effect.expected`).
        implausible: what its numbers cost that no machine is likely to have [nats].
    """

    odds: float
    group: float
    remainder: float
    coverage: float
    explained: bool
    expected: float = 0.0
    implausible: float = 0.0

    @property
    def probability(self) -> float:
        """That the cause is there: its odds among the list, and that it is no stand-in.

        What is outside the list can be approached by what is in it, and then leaves a remainder
        at the same outputs, or asks for numbers that no machine has. One cause outside the list
        does not imitate one effect at several joints.
        """
        return self.odds * self._no_stand_in

    @property
    def group_probability(self) -> float:
        """The same for the cause or one that these logs do not tell from it."""
        return self.group * self._no_stand_in

    @property
    def _no_stand_in(self) -> float:
        score = _LEVEL + self.expected + _COVERAGE * self.coverage + _EXPLAINED * self.explained
        score -= _REMAINDER * np.log(max(self.remainder, _NONE)) + self.implausible
        return float(1.0 / (1.0 + np.exp(-score)))


def support_of(
    trials: Trials, final: Hypothesis, odds: Odds, excess: FloatArray, explained: bool
) -> dict[Key, Support]:
    """Return what speaks for each cause of a hypothesis.

    Args:
        trials: of the search.
        final: the hypothesis.
        odds: of everything that was tried.
        excess: (outputs,) mean squares above the floor that are left unexplained, in floors.
        explained: whether that is too little to ask for one cause more.
    """
    names = [effect.name for effect in final.effects]
    first = np.maximum(trials.nothing.outputs, 1e-300)
    joints = trials.problem.robot.transmission.size
    result = {}
    each = zip(final.effects, odds.rivals(final), final.implausible, strict=True)
    for effect, rivals, implausible in each:
        smaller = trials.of(without(final.effects, effect))
        gain = np.zeros_like(excess) if smaller is None else smaller.outputs - final.outputs
        share = np.maximum(gain, 0.0) / first
        places = names.count(effect.name)
        result[effect.key] = Support(
            odds=odds.of(effect.key),
            group=odds.of_any((effect.key, *rivals)),
            remainder=_ratio(float(share @ (excess / first)), float(share @ share)),
            coverage=(places - 1) * places / joints,
            explained=explained,
            expected=effect.expected,
            implausible=implausible,
        )
    return result


def _ratio(left: float, beside: float) -> float:
    return float(np.sqrt(left / beside)) if beside > 0.0 else float(left > 0.0)
