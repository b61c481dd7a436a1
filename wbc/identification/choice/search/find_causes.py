"""From logs to the hypothesis that they speak for: at once, behind links that swing, near rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf

from wbc.identification.choice.search import moves
from wbc.identification.choice.search.proposals import Proposer
from wbc.identification.choice.search.search import Search, best_of
from wbc.identification.choice.search.yielding_search import YieldingSearch
from wbc.identification.choice.weighing.certainty import UNEXPLAINED_SHARE
from wbc.identification.choice.weighing.hypothesis import Hypothesis
from wbc.identification.choice.weighing.trials import OutOfTime, Trials
from wbc.identification.model.distorted import DISTORTED
from wbc.identification.model.estimation_problem import ONLY_NOISE, EstimationProblem
from wbc.identification.records.preparation import REVERSAL
from wbc.measurement import Log
from wbc.robot import Effect

_WEAK = 9.0  # first error up to which what acts at once may do as well as a link that swings
_CLOSER = 0.5  # of the usual distance to reversals
_SEVERAL = 2  # causes that act at once, in whose place one swinging link may do


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The end of a search.

    Attributes:
        trials: with the logs and every hypothesis that was fitted.
        path: the hypotheses that were the best so far, from the robot as given on.
        final: the hypothesis with the most evidence.
        stopped: why the search ended early, in words; empty where it did not.
    """

    trials: Trials
    path: tuple[Hypothesis, ...]
    final: Hypothesis
    stopped: str = ""


def find_causes(
    problem: EstimationProblem,
    classes: Sequence[type[Effect]],
    report: Callable[[str], None],
    until: float = inf,
) -> SearchResult:
    """Return the hypothesis that the logs speak for, or the best so far where it must stop.

    Args:
        problem: the logs.
        classes: effects that may be used.
        report: called with a line of text as the work proceeds.
        until: time [s] of the monotonic clock at which the search ends.
    """
    trials = Trials(problem, until)
    everything = Search(Proposer(trials, tuple(classes)), report)
    everything.path.append(trials.nothing)
    if not classes:
        return SearchResult(trials, tuple(everything.path), trials.nothing)
    stopped = ""
    try:
        final = _best_end(everything)
    except OutOfTime:
        stopped = "its time was over"
    except KeyboardInterrupt:
        stopped = "it was interrupted"
    if stopped:
        trials.until = inf  # what the answer still needs is fitted
        final = best_of(everything, everything.path)
    return SearchResult(trials, tuple(everything.path), final, stopped)


def _best_end(everything: Search) -> Hypothesis:
    direct = replace(everything, proposer=everything.proposer.at_once)
    ends = [direct.climb(everything.proposer.trials.nothing)]
    if everything.proposer.yielding.candidates:
        ends += _with_yielding_gears(everything, direct, ends[0])
    return best_of(everything, ends)


def _with_yielding_gears(everything: Search, direct: Search, known: Hypothesis) -> list[Hypothesis]:
    """Return where climbs end that begin with links that swing.

    They are simulated, which is slow: they are tried where what acts at once leaves something,
    takes several causes, or explains little to begin with.
    """
    trials = everything.proposer.trials
    first, yielding = trials.nothing, YieldingSearch(everything)
    fine = ONLY_NOISE + DISTORTED**2 * first.error

    def explained(h: Hypothesis) -> bool:
        # Repeats show a floor that a link which bounces is not simulated down to.
        floor = fine if trials.problem.floor.repeats and not h.bounces else yielding.rough
        return h.error < floor

    one, weak = len(known.effects) < _SEVERAL, first.error < _WEAK
    ends: list[Hypothesis] = []
    if weak and known.effects:
        # Where little was to be explained, much looks like a soft gear: what is tried in the
        # place of a cause is at least an alternative.
        other = everything.best(moves.swaps(everything.proposer, known), known)
        ends += [] if other is None else [direct.climb(other)]
    early = next((h for h in everything.path if len(h.effects) == 1), None)
    for origin in dict.fromkeys((first, known, early or first)):
        best = min([known, *ends], key=lambda h: h.error)
        if explained(best) and (origin is not first or (one and not weak)):
            break
        swung = yielding.swung(origin)
        if swung is not origin:
            ends.append(direct.climb(swung))
    best = best_of(everything, [known, *ends])
    soft = best.error > yielding.rough and best.swings and not best.bounces
    if soft and (loose := yielding.loose_beside(best)) is not None:
        ends.append(direct.climb(loose))
        best = best_of(everything, [best, ends[-1]])
    if best.error > yielding.rough:
        both = yielding.pair_beside(best)
        if both is not None:
            ends.append(direct.climb(both))
    return ends


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
