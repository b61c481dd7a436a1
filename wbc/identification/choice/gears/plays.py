"""Which play and flanks explain what a log leaves unexplained."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.links import COARSE, DrivenLinks, LinkResponse
from wbc.transmission import Flanks

_FINE = 1e-3  # [s], of the last ranking
_PLAY = 0.25  # of what flanks wind up by, below which they are a spring
_BUSIEST = 3.0  # [s] of each log on which the grid is ranked
_BEGINNINGS = (2.5, 6.0)  # [s] on which clouds are: with wrong flanks a link soon strays
_WIDTHS = ((0.5, COARSE), (0.3, _FINE), (0.15, _FINE), (0.07, _FINE))  # of clouds, and their steps
_CLOUD = 48  # flanks tried around good ones
_PLACES = 2  # in which a link may begin, whichever the log shows
_HOPELESS = 0.9  # share of what is unexplained that the best of the grid leaves
_GRID = tuple(
    Flanks(stiffness, damping, float(play))
    for play in (0.0005, 0.0008, 0.0013, *np.geomspace(0.002, 0.12, 9))
    for stiffness in (1000.0, 5000.0, 25000.0)
    for damping in (5.0, 20.0)
)


def best_plays(responses: Sequence[LinkResponse], count: int) -> list[Flanks]:
    """Return the `count` pairs of flanks whose deflection leaves least unexplained.

    A link that bounces follows no gradient: a coarse grid is integrated over the seconds of each
    log in which most is unexplained, then, where that promises something, clouds of flanks
    around the best over a short and over a longer beginning of the logs, whose best take turns. A
    link without inertia about the joint (a point on its axis) swings behind nothing, and behind
    flanks that wind up by far more than their play it is behind a spring: the list is empty.

    Args:
        responses: of the joint, one per log.
        count: how many to return.
    """
    row = responses[0].row
    if min(float(np.min(response.inertia[:, row])) for response in responses) <= 0.0:
        return []
    step, shortest = responses[0].step, min(len(r.unexplained) for r in responses)
    length = min(int(_BUSIEST / step), shortest)
    busiest = [_busiest(response.unexplained, length) for response in responses]
    largest = max(float(np.max(np.abs(response.load[:, row]))) for response in responses)
    loose = [flanks for flanks in _GRID if plays(flanks, largest)]
    if not loose:
        return []
    ranked, share = _ranked(loose, responses, busiest, COARSE)
    if share > _HOPELESS:
        return ranked[:count]
    lists = [_around(ranked[:_CLOUD], responses, int(seconds / step)) for seconds in _BEGINNINGS]
    return [flanks for pair in zip(*lists, strict=True) for flanks in pair][:count]


def plays(flanks: Flanks, load: float) -> bool:
    """Whether play counts beside what its flanks wind up by under a load [N m]."""
    return flanks.play * flanks.stiffness > _PLAY * load


def _around(
    ranked: Sequence[Flanks], responses: Sequence[LinkResponse], length: int
) -> list[Flanks]:
    """Return good flanks and clouds around the best, ranked on the beginnings of the logs."""
    beginning = [slice(0, min(length, len(r.unexplained))) for r in responses]
    best, _ = _ranked(ranked, responses, beginning, COARSE)
    random = np.random.default_rng(0)
    for width, finest in _WIDTHS:
        kept = best[:2]
        cloud = [c.scaled(*np.exp(width * row)) for c in kept for row in _normal(random)]
        best, _ = _ranked([*kept, *cloud], responses, beginning, finest)
    return best


def _normal(random: np.random.Generator) -> FloatArray:
    """Return factors' logarithms: flanks are known far worse than the play between them."""
    return np.asarray(random.standard_normal((_CLOUD, 3)) * (2.0, 2.0, 0.5))


def _ranked(
    trials: Sequence[Flanks],
    responses: Sequence[LinkResponse],
    parts: Sequence[slice],
    finest: float,
) -> tuple[list[Flanks], float]:
    """Return flanks by what they leave unexplained on a part of each log, and the least share.

    Where the link flies off in both of its beginnings nothing is explained.
    """
    left = np.zeros(len(trials))
    nothing = 0.0
    for response, part in zip(responses, parts, strict=True):
        links = DrivenLinks.of([response]).part(part)
        torques = [links.torques([c], _starts(links, c), finest)[:, 0] for c in trials]
        whole = np.zeros((len(response.unexplained), 1 + len(trials), _PLACES))
        whole[part] = response.unexplained[part, None, None]
        whole[part, 1:] -= np.stack(torques, axis=1)
        lost = ~np.isfinite(whole).all(axis=0)
        whole[:, lost] = 0.0
        squares = np.where(lost, np.inf, np.sum(response.band(whole) ** 2, axis=0)).min(axis=1)
        nothing += float(squares[0])
        left += squares[1:]
    ranked = [trials[i] for i in np.argsort(left)]
    return ranked, float(left.min()) / max(nothing, 1e-300)


def _starts(links: DrivenLinks, flanks: Flanks) -> FloatArray:
    """Return starts (2, 1, 2): against the flank that carries the load, and in the middle."""
    load = float(links.load[0, 0])
    starts = np.zeros((2, 1, _PLACES))
    starts[0, 0, 0] = -load / flanks.stiffness - np.sign(load) * 0.5 * flanks.play
    return starts


def _busiest(torque: FloatArray, length: int) -> slice:
    """Return the window of `length` samples with the largest torque."""
    total = np.concatenate([[0.0], np.cumsum(torque**2)])
    start = int(np.argmax(total[length:] - total[:-length]))
    return slice(start, start + length)
