"""Proximal point iteration: the step with a little compliance in every row, taken out again.

More rigid rows than freedoms (two flat feet, stuck gears) leave the split of internal forces open
and Newton's systems singular. With a compliance eps Lambda_ii about the last iterate every system
is regular; at the fixed point the compliance carries nothing and the step is solved as it stands.
"""

from __future__ import annotations

from dataclasses import replace

from wbc.arrays import FloatArray
from wbc.sim.solve.newton import newton
from wbc.sim.solve.reduced import IN_IMPULSES, Reduced

_FIRST, _SMALLEST, _LARGEST = 1e-6, 1e-9, 1.0
_HARDER, _SOFTER = 0.3, 30.0
_ROUNDS = 60
_INNER = 10


def proximal(reduced: Reduced, start: FloatArray, tolerance: float) -> tuple[FloatArray, int, bool]:
    """Iterate from row impulses `start` (r,) until every row is on its law.

    A split of forces that has to move far (a corner of a sole that must let go before the rest
    fits) moves by rounding errors over compliance per round: each round that Newton solves makes
    the rows harder, each that it does not makes them softer.

    Returns:
        the row impulses, the number of linear systems solved, and whether it converged.
    """
    used, impulse, compliance = 0, start, _FIRST
    for _ in range(_ROUNDS):
        following, count, inner = newton(
            _softened(reduced, compliance, impulse), impulse, tolerance, _INNER
        )
        used += count
        if reduced.distance(following) <= tolerance:
            return following, used, True
        if inner:
            impulse, compliance = following, max(_HARDER * compliance, _SMALLEST)
        else:
            compliance *= _SOFTER
            if compliance > _LARGEST:
                break
    return impulse, used, False


def _softened(reduced: Reduced, compliance: float, about: FloatArray) -> Reduced:
    """Return the step with the compliance in series with every row, unloaded at `about`."""
    own = compliance * reduced.diagonal
    delassus = reduced.delassus.copy()
    delassus.ravel()[:: len(own) + 1] += own
    return replace(
        reduced,
        delassus=delassus,
        free=reduced.free - own * about,
        diagonal=(1.0 + compliance) * reduced.diagonal,
        spring=(1.0 + compliance) * reduced.spring,
        slope=reduced.slope / (1.0 + compliance),
        ways=IN_IMPULSES,
    )
