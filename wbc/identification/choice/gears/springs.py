"""Which springs and dampers in a gear explain what a log leaves unexplained."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.links import DrivenLinks, LinkResponse, likely_start, typical_start
from wbc.transmission import Flanks

_DAMPING_RATIOS = (0.02, 0.1, 0.4)
_STIFFNESSES = np.geomspace(20.0, 20000.0, 22)
_NEAR = (0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25)
_HOPELESS = 0.9  # share of what is unexplained that the best of the grid leaves
_VARIED = 1e-6  # [rad, rad/s] of a start, for what it changes


def best_springs(responses: Sequence[LinkResponse], count: int) -> list[Flanks]:
    """Return the `count` springs that leave least unexplained, best first.

    A lightly damped swing keeps its phase for long, so the best of a coarse grid is searched around
    twice more, unless it promises nothing. A link without inertia about the joint (a point on its
    axis) swings behind nothing: the list is empty. So it is where no link stays behind a spring.

    Args:
        responses: of the joint, one per log.
        count: how many to return.
    """
    inertias = [r.inertia[:, r.row] for r in responses]
    if min(float(inertia.min()) for inertia in inertias) <= 0.0:
        return []
    typical = float(np.mean([np.mean(inertia) for inertia in inertias]))

    def damped(stiffness: float, ratio: float) -> Flanks:
        return Flanks(float(stiffness), float(2.0 * ratio * np.sqrt(stiffness * typical)))

    springs = [damped(k, ratio) for k in _STIFFNESSES for ratio in _DAMPING_RATIOS]
    left = _left(responses, springs)
    first = np.argsort(left)[: max(2, count)]
    known = {springs[k]: left[k] for k in first}
    whole = sum(float(np.sum(r.left(np.zeros(len(r.load))) ** 2)) for r in responses)
    if left.min() < _HOPELESS * whole:
        near = [s.scaled(f, c, 0.0) for s in list(known)[:2] for f in _NEAR for c in (0.4, 1.0)]
        new = [spring for spring in dict.fromkeys(near) if spring not in known]
        known |= dict(zip(new, _left(responses, new), strict=True))
    best = sorted(known, key=lambda spring: known[spring])
    return [spring for spring in best if np.isfinite(known[spring])][:count]


def _left(responses: Sequence[LinkResponse], springs: Sequence[Flanks]) -> FloatArray:
    """Return (P,) the squares that each spring leaves, with the start that leaves least.

    Infinite where the link flies off.
    """
    total = np.zeros(len(springs))
    for response in responses:
        torques = _torques(response, springs)
        stays = np.isfinite(torques).all(axis=(0, 1))
        total[~stays] = np.inf
        held = torques[:, :, stays]
        band = response.band(held.reshape(len(held), -1)).reshape(-1, *held.shape[1:])
        wanted = response.left(np.zeros(len(torques)))[:, None] - band[:, 0]
        for column, p in enumerate(np.flatnonzero(stays).tolist()):
            free, aim = band[:, 1:, column], wanted[:, column]
            start = likely_start(free, aim, typical_start(response, springs[p]))
            total[p] += np.sum((aim - free @ start) ** 2)
    return total


def _torques(response: LinkResponse, springs: Sequence[Flanks]) -> FloatArray:
    """Return (N, 3, P) the joint's additional torque: from rest, and per free swing.

    By the balance of the link it is what the gear passes on less the load.
    """
    links = DrivenLinks.of([response])
    starts = _VARIED * np.eye(2, 3, k=1)[:, None]
    torque = np.empty((len(links.load), 3, len(springs)))
    with np.errstate(invalid="ignore"):
        for p, spring in enumerate(springs):
            d, v, _ = links.follow([spring], starts, coarsest=np.inf)
            torque[:, :, p] = spring.torque(d[:, 0], v[:, 0])
        torque[:, 1:] = (torque[:, 1:] - torque[:, :1]) / _VARIED
    torque[:, 0] -= links.load + links.counted
    return torque
