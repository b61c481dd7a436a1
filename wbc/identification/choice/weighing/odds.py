"""How probable each cause is, and what could stand in its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.identification.choice.weighing.evidence import weigh
from wbc.identification.choice.weighing.hypothesis import Hypothesis, Key
from wbc.identification.choice.weighing.trials import Trials

TIED = 3.0
"""Evidence [nats] within which two hypotheses are not told apart."""


@dataclass(frozen=True, eq=False)
class Odds:
    """What the hypotheses that were tried say together.

    Attributes:
        hypotheses: the best of each set of causes, most evidence first.
        evidence: (n,) of each beside the first [nats].
        shares: (n,) probability of each.
    """

    hypotheses: tuple[Hypothesis, ...]
    evidence: tuple[float, ...]
    shares: tuple[float, ...]

    @property
    def nothing(self) -> float:
        """How probable it is that no cause is missing, among what was tried."""
        pairs = zip(self.hypotheses, self.shares, strict=True)
        return sum(share for h, share in pairs if not h.effects)

    def of(self, key: Key) -> float:
        """Return how probable a cause is: that of the hypotheses that hold it."""
        return self.of_any((key,))

    def of_any(self, keys: Sequence[Key]) -> float:
        """Return how probable it is that one of some causes is there."""
        pairs = zip(self.hypotheses, self.shares, strict=True)
        return sum(share for h, share in pairs if not set(keys).isdisjoint(h.keys))

    def rivals(self, final: Hypothesis) -> tuple[tuple[Key, ...], ...]:
        """Return for every cause of a hypothesis what could stand in its place.

        A hypothesis that lacks some causes and has others instead, with as much evidence.
        """
        own = set(final.keys)
        level = self.level(final)
        found: list[dict[Key, None]] = [{} for _ in final.keys]
        for other, nats in zip(self.hypotheses, self.evidence, strict=True):
            gone, new = own - set(other.keys), [k for k in other.keys if k not in own]
            if not gone or not new or nats < level - TIED:
                continue
            for k, key in enumerate(final.keys):
                if key in gone:
                    here = [rival for rival in new if rival[1] == key[1]]
                    found[k] |= dict.fromkeys(here if len(gone) > 1 and here else new)
        return tuple(tuple(rivals) for rivals in found)

    def level(self, final: Hypothesis) -> float:
        """Return the evidence of a hypothesis that was tried, beside the first [nats]."""
        keys = frozenset(final.keys)
        pairs = zip(self.hypotheses, self.evidence, strict=True)
        return next(nats for h, nats in pairs if frozenset(h.keys) == keys)


def odds_of(
    trials: Trials,
    known: Sequence[Hypothesis] | None = None,
    final: Hypothesis | None = None,
) -> Odds:
    """Return the odds of everything believable that was tried on one problem.

    Args:
        trials: on the problem.
        known: what is compared, by default all that was tried.
        final: one that is compared even if it is not believable: what is left of an answer once
            its doubtful causes are gone.
    """
    tried = [h for h in (trials.known if known is None else known) if h.believable]
    if final is not None and frozenset(final.keys) not in {frozenset(h.keys) for h in tried}:
        tried.append(final)
    scores = weigh(trials.problem, tried)
    best: dict[frozenset[Key], tuple[float, Hypothesis]] = {}
    for h, score in zip(tried, scores, strict=True):
        keys = frozenset(h.keys)
        if keys not in best or score > best[keys][0]:
            best[keys] = float(score), h
    ranked = sorted(best.values(), key=lambda pair: -pair[0])
    evidence = np.array([score for score, _ in ranked]) - ranked[0][0]
    weight = np.exp(evidence)
    weight /= weight.sum()
    return Odds(tuple(h for _, h in ranked), tuple(evidence.tolist()), tuple(weight.tolist()))
