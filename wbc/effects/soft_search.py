"""Which springs and dampers in a gear explain what a log leaves unexplained."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.rubbing_link import held
from wbc.effects.soft_link import Spring, likely_start, swings, typical_start
from wbc.robot import LinkResponse

_DAMPING_RATIOS = (0.02, 0.1, 0.4)
_STIFFNESSES = np.geomspace(20.0, 20000.0, 22)
_NEAR = (0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25)
_HOPELESS = 0.9  # share of what is unexplained that the best of the grid leaves


def best_springs(responses: Sequence[LinkResponse], count: int) -> list[Spring]:
    """Return the `count` pairs of stiffness and damping that leave least unexplained, best first.

    A lightly damped swing keeps its phase for long, so the best of a coarse grid is searched around
    twice more, unless it promises nothing. A link without inertia about the joint (a point on its
    axis) swings behind nothing: the list is empty.

    Args:
        responses: of the joint, one per log.
        count: how many to return.
    """
    inertias = [r.inertia[:, r.row] for r in responses]
    if min(float(inertia.min()) for inertia in inertias) <= 0.0:
        return []
    typical = float(np.mean([np.mean(inertia) for inertia in inertias]))

    def damped(stiffness: float, ratio: float) -> Spring:
        return float(stiffness), float(2.0 * ratio * np.sqrt(stiffness * typical))

    pairs = [damped(k, ratio) for k in _STIFFNESSES for ratio in _DAMPING_RATIOS]
    left = _left(responses, pairs)
    first = np.argsort(left)[: max(2, count)]
    known = {pairs[k]: left[k] for k in first}
    whole = sum(float(np.sum(r.left(np.zeros(len(r.load))) ** 2)) for r in responses)
    if left.min() < _HOPELESS * whole:
        near = [(k * f, c * s) for k, c in list(known)[:2] for f in _NEAR for s in (0.4, 1.0)]
        new = [pair for pair in dict.fromkeys(near) if pair not in known]
        known |= dict(zip(new, _left(responses, new), strict=True))
    return sorted(known, key=lambda pair: known[pair])[:count]


def _left(responses: Sequence[LinkResponse], pairs: Sequence[Spring]) -> FloatArray:
    """Return (P,) the squares that each spring leaves, with the start that leaves least."""
    total = np.zeros(len(pairs))
    for response in responses:
        torques = _torques(response, pairs)
        band = response.band(torques.reshape(len(torques), -1)).reshape(-1, *torques.shape[1:])
        wanted = response.left(np.zeros(len(torques)))[:, None] - band[:, 0]
        for p, pair in enumerate(pairs):
            free = band[:, 1:, p]
            start = likely_start(free, wanted[:, p], typical_start(response, pair))
            total[p] += np.sum((wanted[:, p] - free @ start) ** 2)
    return total


def _torques(response: LinkResponse, pairs: Sequence[Spring]) -> FloatArray:
    """Return (N, 3, P) the joint's additional torque: from rest, and per free swing.

    By the balance of the link it is what the gear passes on less the load.
    """
    row = response.row
    inertia, drag, pull = (
        getattr(response, name)[:, [row], None] for name in ("inertia", "damping", "stiffness")
    )
    load = response.load[:, [row]]
    rubs = response.friction
    torque = np.empty((len(load), 3, len(pairs)))
    for p, (stiffness, damping) in enumerate(pairs):
        link = inertia, drag + damping, pull + stiffness, load
        if rubs is None:
            d, v = swings(*link, response.step, 1)
        else:
            d, v = held(*link, rubs, response.step)
        torque[:, :, p] = -stiffness * d[:, 0] - damping * v[:, 0]
    torque[:, 0] -= load
    if rubs is not None:
        torque[:, 0] -= rubs.counted[:, None]
    return torque
