"""A second look at logs, nearer to the moments at which joints turn round."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf

from wbc.identification.choice.search.find_causes import SearchResult
from wbc.identification.choice.search.proposals import Proposer
from wbc.identification.choice.search.search import Search
from wbc.identification.choice.weighing.certainty import UNEXPLAINED_SHARE
from wbc.identification.choice.weighing.trials import OutOfTime, Trials
from wbc.identification.model.estimation_problem import ONLY_NOISE, EstimationProblem
from wbc.identification.records.preparation import REVERSAL
from wbc.measurement import Log
from wbc.robot import Effect

_CLOSER = 0.5  # of the usual distance to reversals


def look_closer(
    found: SearchResult,
    logs: Sequence[Log],
    classes: Sequence[type[Effect]],
    report: Callable[[str], None],
) -> SearchResult:
    """Return the end of a search with what acts near rest only, or `found` where nothing does.

    Around reversals smoothing hides when a joint turned round, and the search looks away: so far
    that friction which is gone at 0.2 rad/s would not be seen. Where everything else is
    explained, what is left there is worth a look.

    Args:
        found: from the usual distance.
        logs: in which it was found.
        classes: effects that may be used.
        report: called with a line of text as the work proceeds.
    """
    slow = tuple(c for c in classes if c.search.near_rest)
    explained = found.final.error < ONLY_NOISE + UNEXPLAINED_SHARE**2 * found.trials.nothing.error
    # Where a link that is simulated strikes or swings through, it is simulated worst.
    if not slow or not explained or found.final.swings or found.stopped:
        return found
    try:
        near = found.trials.problem.nearer(logs, _CLOSER * REVERSAL)
        return _closer(found, near, classes, report)
    except OutOfTime:
        return replace(found, stopped="its time was over")
    except KeyboardInterrupt:
        return replace(found, stopped="it was interrupted")


def _closer(
    found: SearchResult,
    problem: EstimationProblem,
    classes: Sequence[type[Effect]],
    report: Callable[[str], None],
) -> SearchResult:
    slow = tuple(c for c in classes if c.search.near_rest)
    near = Trials(problem, found.trials.until)
    start = near.of(found.final.effects)
    if start is None:
        return found
    first = Search(Proposer(near, slow), report)
    begun = first.lengthen(start)  # a swap of what is known is no answer here
    if begun is start:
        return found
    whole = replace(first, proposer=Proposer(near, tuple(classes)).at_once)
    final = whole.climb(begun)
    known, seen = set(found.final.keys), set(final.keys)
    slowly = any(e.search.near_rest for e in final.effects if e.key not in known)
    if not slowly or not known <= seen:
        return found
    near.until = inf
    return SearchResult(near, (near.nothing, *first.path, *whole.path), final)
