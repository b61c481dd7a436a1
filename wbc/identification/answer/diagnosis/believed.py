"""The part of a search's end that is believed: the answer."""

from __future__ import annotations

from dataclasses import dataclass, replace

from wbc.identification.answer.attainable import Attainable, attainable
from wbc.identification.choice.find_causes import SearchResult
from wbc.identification.choice.weighing.certainty import (
    BELIEVED,
    Support,
    beliefs,
    least_believed,
    support_of,
    unexplained,
)
from wbc.identification.choice.weighing.evidence import weigh
from wbc.identification.choice.weighing.hypothesis import Hypothesis, Key
from wbc.identification.choice.weighing.odds import Odds, odds_of
from wbc.identification.choice.weighing.trials import Trials


@dataclass(frozen=True)
class Answer:
    """A hypothesis, judged.

    Attributes:
        hypothesis: the causes with their fit.
        odds: of all that was tried beside it.
        level: what it leaves, and how much of that any model could explain.
        support: what speaks for each cause.
        rivals: what could stand in the place of each.
        more: whether more must be missing.
    """

    hypothesis: Hypothesis
    odds: Odds
    level: Attainable
    support: dict[Key, Support]
    rivals: dict[Key, tuple[Key, ...]]
    more: bool

    @property
    def doubted(self) -> Key | None:
        """The least believed cause, None where every one is more probable than not."""
        return least_believed({key: s.group_probability for key, s in self.support.items()})


def believed(found: SearchResult) -> Answer:
    """Return the hypothesis with those causes only that are more probable than not.

    It is that with the most evidence where all of it is believed, else the end of the search where
    all of that is: on a recorded double pendulum the first held a wrong drawing (0.46), and the
    search had taken it back. Else the least believed cause goes first, and the others are judged
    again without it: two that share what they explain may both be doubted while one of them alone
    is not.
    """
    trials, end = found.trials, found.final
    doubted: set[Key] = set()
    # What the derivatives doubt goes first: a fit without each cause takes longer.
    while least := least_believed(beliefs(trials, end)):
        doubted.add(least)
        end = best_without(trials, end, doubted)
    best = best_without(trials, end, doubted)
    answer = judged(trials, best, doubted)
    if answer.doubted and best is not end:
        other = judged(trials, end, doubted)
        answer = answer if other.doubted else other
    while least := answer.doubted:
        doubted.add(least)
        answer = judged(trials, best_without(trials, answer.hypothesis, doubted), doubted)
    # Where something was found and nothing of it is believed, something else is there, unless the
    # logs hardly speak against the robot as given.
    missing = not answer.hypothesis.effects and 1.0 - odds_of(trials).nothing >= BELIEVED
    return replace(answer, more=answer.more or missing)


def judged(trials: Trials, h: Hypothesis, doubted: set[Key]) -> Answer:
    """Return a hypothesis with what speaks for its causes.

    Args:
        trials: of the search.
        h: the hypothesis.
        doubted: causes that are not believed: what holds them is no evidence.
    """
    # What rests on a cause that is not believed is no evidence for others.
    odds = odds_of(trials, [k for k in trials.known if doubted.isdisjoint(k.keys)], h)
    level = attainable(trials.problem, trials.fit(h))
    more = unexplained(trials.nothing.error, h, level.excess)
    support = support_of(trials, h, odds, level.excess, not more)
    rivals = dict(zip(h.keys, odds.rivals(h), strict=True))
    return Answer(h, odds, level, support, rivals, more)


def best_without(trials: Trials, final: Hypothesis, doubted: set[Key]) -> Hypothesis:
    """Return the hypothesis with the most evidence of those that hold no doubted cause.

    What is not believed may have taken the place of something else, and others may rest on it: on
    a recorded double pendulum a torque ripple stood where a rotor inertia belongs, and on a
    recorded arm five rotor inertias made up for drawings that were not believed.
    """
    rest = [h for h in trials.known if h.believable and doubted.isdisjoint(h.keys)]
    fewer = trials.of([e for e in final.effects if e.key not in doubted])
    if fewer is not None and all(fewer is not h for h in rest):
        rest.append(fewer)
    while True:
        best = rest[int(weigh(trials.problem, rest).argmax())]
        ended = trials.ended(best)
        if ended is best:
            return best
        rest = [ended if h is best else h for h in rest]
