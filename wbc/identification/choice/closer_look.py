"""A second look at logs, nearer to the moments at which joints turn round."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wbc.identification.choice.conclusion import Conclusion, conclude
from wbc.identification.choice.selection import Selector
from wbc.identification.model.problem import Problem
from wbc.identification.records.preparation import REVERSAL
from wbc.measurement import Log
from wbc.robot import Robot

_CLOSER = 0.5  # of the usual distance to reversals


def look_closer(found: Conclusion, robot: Robot, logs: Sequence[Log]) -> Conclusion:
    """Return the conclusion with what acts near rest only, or `found` where nothing does.

    Around reversals smoothing hides when a joint turned round, and the search looks away: so far
    that friction which is gone at 0.2 rad/s would not be seen. Where everything else is
    explained, what is left there is worth a look.

    Args:
        found: from the usual distance.
        robot: that the user believes in.
        logs: the same.
    """
    kinds = tuple(c for c in found.selector.candidates if c.near_rest)
    explained = found.verdict in ("none", "named", "ambiguous")
    # Where a link that is simulated strikes or swings through, it is simulated worst.
    if not kinds or not explained or found.final.swings:
        return found
    near = Problem.from_logs(robot, logs, _CLOSER * REVERSAL)
    selector = Selector(near, found.selector.candidates, report=found.selector.report)
    first, start = selector.model(()), selector.model(found.final.effects)
    begun = [first, start] if start is not first else [first]
    # Beside what was found only what the first look could not see is sought.
    slow = replace(selector, candidates=kinds) if start is not first else selector
    path = slow.run(begun)
    if len(path) == len(begun):
        return found
    closer = conclude(selector, path, selector.prune(path[-1], first))
    known = {e.key for e in found.final.effects}
    seen = {e.key for e in closer.final.effects}
    slowly = any(e.near_rest for e in closer.final.effects if e.key not in known)
    better = slowly and known <= seen and closer.verdict in ("named", "ambiguous")
    return closer if better else found
