"""From logs to the hypothesis that they speak for: at once, behind links that swing, near rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from wbc.effects.gear_losses import YieldingGear
from wbc.identification.choice.certainty import UNEXPLAINED_SHARE
from wbc.identification.choice.evidence import Hypothesis, weigh
from wbc.identification.choice.gears import gears_beside, two_gears
from wbc.identification.choice.plain_models import plain_fits
from wbc.identification.choice.proposals import Proposer
from wbc.identification.choice.search import Search
from wbc.identification.choice.trials import OutOfTime, Trials
from wbc.identification.model.estimation_problem import ONLY_NOISE, EstimationProblem
from wbc.identification.model.yielding import deflects
from wbc.identification.records.preparation import REVERSAL
from wbc.robot import Effect

RIVALS = 3
"""Rivals of an answer that are always fitted: as many as an experiment is planned for."""
INTERRUPTED, _OVER = "it was interrupted", "its time was over"

_WEAK = 9.0  # first error up to which what acts at once may do as well as a link that swings
_SIMULATED = 0.04  # share of the first error to which links behind soft gears are simulated
_AT_ONCE = 2  # causes that act at once, which are fitted beside the gears for a second one
# Share of the first error that what acts at once leaves of two links that shake one another: 1.0
# behind two soft gears, 0.58 behind a soft and a loose one. It left 0.04 and 0.003 of two recorded
# arms, where the grid of two gears took 100 CPU s.
_SHAKEN = 0.25


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The end of a search.

    Attributes:
        trials: with the logs and every hypothesis that was fitted.
        final: the hypothesis with the most evidence.
        stopped: why the search ended early, in words; empty where it did not.
    """

    trials: Trials
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
    trials = Trials(problem)
    at_once = tuple(kind for kind in classes if not deflects(kind))
    direct = Search(Proposer(trials, at_once), report, [trials.nothing])
    if not classes:
        return SearchResult(trials, trials.nothing)
    stopped = ""
    try:
        # Every answer is held against them: those of the joints cost next to nothing, and are made
        # without any time.
        plain_fits(trials, at_once, links=False)
        trials.until = until
        ends = [direct.climb(trials.nothing)]
        # What is left beside a wrong drawing is imitated; where all that is plain together does
        # better than what was found, it is the better start.
        noise = ends[0].only_noise(problem)
        plain = None if noise else direct.best(plain_fits(trials, at_once), ends[0])
        if plain is not None:
            direct.path.append(plain)
            ends.append(direct.climb(plain))
        if gears := [kind for kind in classes if issubclass(kind, YieldingGear)]:
            ends += _with_yielding_gears(direct, gears, trials.best_of(ends))
        final = trials.best_of(ends)
        if final.swings:  # a fit of links that bounce may go on from where it ended
            again = trials.of(final.effects, final) or final
            final = min(final, again, key=lambda h: h.error)
        else:  # an answer says by how much what comes nearest to it is worse
            nearest = direct.proposer.exchanges(final, RIVALS, hopeless=True)
            trials.rivals_of(final, nearest[:RIVALS])
    except OutOfTime:
        stopped = _OVER
    except KeyboardInterrupt:
        stopped = INTERRUPTED
    if stopped:
        final = trials.best_of(direct.path)
    return SearchResult(trials, final, stopped)


def _with_yielding_gears(
    direct: Search, gears: Sequence[type[YieldingGear]], known: Hypothesis
) -> list[Hypothesis]:
    """Return where climbs end that begin with links that swing.

    They are simulated, which is slow: they are tried where what acts at once leaves something,
    takes several causes, or explains little to begin with.
    """
    trials = direct.proposer.trials
    first = trials.nothing
    rough = ONLY_NOISE + _SIMULATED**2 * first.error
    one, weak = len(known.effects) < 2, first.error < _WEAK
    ends: list[Hypothesis] = []
    early = next((h for h in direct.path if len(h.effects) == 1), None)
    for origin in dict.fromkeys((first, known, early or first)):
        best = min([known, *ends], key=lambda h: h.error)
        if best.error < rough and (origin is not first or (one and not weak)):
            break
        swung = _swung(direct, gears, origin, rough, best)
        if swung is not origin:
            # A gear that is not believed beside all that is known only imitates that. Where nothing
            # else is known a second fit would tell nothing new, and may end in another valley.
            others = [e for e in known.effects if e.key not in swung.keys]
            whole = (trials.of((*swung.effects, *others)) if others else None) or swung
            gains = np.diff(weigh(trials.problem, [swung, whole]))[0] > 0.0
            ends += [direct.climb(swung)] if whole.believable or not gains else []
    shaken = not weak and known.error > _SHAKEN * first.error
    if shaken and min(h.error for h in (known, *ends)) > rough:
        # A loose gear found alone holds in its numbers what another one does.
        two = direct.best(trials.all_of(two_gears(trials, gears)), first)
        ends += [] if two is None else [direct.climb(two)]
    return ends


def _swung(
    direct: Search,
    gears: Sequence[type[YieldingGear]],
    origin: Hypothesis,
    enough: float,
    known: Hypothesis,
) -> Hypothesis:
    """Return a hypothesis with links that swing, as many as add to the evidence.

    Args:
        direct: the search among what acts at once.
        gears: effects that let a link swing.
        origin: beside which they are sought.
        enough: error at which no more are sought.
        known: what explains most so far.
    """
    trials, current = direct.proposer.trials, origin
    while current is origin or current.error > enough:
        offers = gears_beside(trials, trials.fit(current), trials.fit(known), gears)
        if current is not origin:
            # What acts at once at a link that swings is no second gear.
            offers += direct.proposer.beside(current, _AT_ONCE)
        longer = direct.best(trials.all_of(offers), current)
        if longer is None or not deflects(longer.effects[-1]):
            break
        direct.report(
            f"{longer.effects[-1].name} at {longer.effects[-1].where}: "
            f"{longer.error**0.5:.2f} noise floors"
        )
        current = longer
    return current


_CLOSER = 0.5  # of the usual distance to reversals


def look_closer(
    found: SearchResult,
    classes: Sequence[type[Effect]],
    report: Callable[[str], None],
) -> SearchResult:
    """Return the end of a search with what acts near rest only, or `found` where nothing does.

    Around reversals smoothing hides when a joint turned round, and the search looks away: so far
    that friction which is gone at 0.2 rad/s would not be seen. Where everything else is
    explained, what is left there is worth a look.

    Args:
        found: from the usual distance.
        classes: effects that may be used.
        report: called with a line of text as the work proceeds.
    """
    slow = tuple(c for c in classes if c.search.near_rest)
    explained = found.final.error < ONLY_NOISE + UNEXPLAINED_SHARE**2 * found.trials.nothing.error
    # Where a link that is simulated strikes or swings through, it is simulated worst.
    if not slow or not explained or found.final.swings or found.stopped:
        return found
    at_once = tuple(c for c in classes if not deflects(c))
    try:
        near = Trials(found.trials.problem.nearer(_CLOSER * REVERSAL), found.trials.until)
        start = near.of(found.final.effects)
        if start is None:
            return found
        # A swap of what is known is no answer here.
        begun = Search(Proposer(near, slow), report).lengthen(start)
        if begun is start:
            return found
        final = Search(Proposer(near, at_once), report).climb(begun)
    except OutOfTime:
        return replace(found, stopped=_OVER)
    except KeyboardInterrupt:
        return replace(found, stopped=INTERRUPTED)
    known = set(found.final.keys)
    slowly = any(e.search.near_rest for e in final.effects if e.key not in known)
    return SearchResult(near, final) if slowly and known <= set(final.keys) else found
