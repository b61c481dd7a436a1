"""How links behind gears with play moved when a log began: drawn, for they follow no gradient."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from wbc.arrays import FloatArray
from wbc.links.driven_links import COARSE, DrivenLinks
from wbc.links.response import LinkResponse
from wbc.transmission import Flanks

_START = 0.6  # [s] of the log by which beginnings are chosen ...
# ... and of one close by: with 15 and 20 mrad of play the true numbers left 216 of 5000 by 0.6 s,
# 129 by 0.9 s, 121 by 1.2 s and 120 by 2 s.
_LONGER = 1.2
_BEGINNINGS = 32  # drawn at first ...
_NEARBY = 16  # ... and around the best of them, in rounds ...
_WIDTHS = (0.3, 0.1)  # ... of these widths, as shares of what is typical
_STEPS = 8  # of least squares at the end (35 mrad at a hip left 1220 after 3, 804 after 8), ...
_LENGTHS = (1.0, 0.4, 0.1)  # ... of which shares are tried
_VARIED = 1e-3  # of what is typical, for derivatives
# Share of the squares that a step must promise. Of 5200 steps that promised less, on a leg with
# play, none took away more than 2e-6; they were a quarter of all.
_PROMISED = 1e-6
_BEYOND = 1.3  # of a gear's wind-up under its load: how far a link may begin from the middle


def striking_start(
    responses: Sequence[LinkResponse],
    links: DrivenLinks,
    gears: Sequence[Flanks],
    near: FloatArray | None = None,
) -> FloatArray:
    """Return deflections and rates (2, n) with which the log began.

    Beginnings are drawn, then others around the best, from which it is a short way. The same are
    drawn every time, so that what is left depends on the gears alone.

    Args:
        responses: of the n links along one log.
        links: what drives them.
        gears: in front of them.
        near: a start close to which it lies; None where nothing is known.
    """
    seconds = _START if near is None else _LONGER
    first = links.part(slice(0, int(seconds / links.step)))
    typical = _typical(links, gears)

    def left(trials: FloatArray, coarsest: float = 0.0) -> FloatArray:
        starts = np.moveaxis(typical * trials, 0, -1)
        return _left(responses, first.torques(gears, starts, coarsest))

    if near is not None:
        best = near / typical
        return np.asarray(typical * _descended(best, left(best[None])[:, 0], left))
    random = np.random.default_rng(0)
    size = (2, len(gears))
    # In the middle, touching a flank, or wound up against it.
    touching = 0.5 * np.array([gear.play for gear in gears]) / typical[0]
    places = [sorted({-1.0, -float(t), 0.0, float(t), 1.0}) for t in touching]
    sides = np.array(list(product(*places)))
    drawn = random.uniform(-_BEYOND, _BEYOND, (_BEGINNINGS, *size))
    trials = np.concatenate([np.stack([sides, 0.0 * sides], axis=1), drawn])
    best, _ = _best(trials, left(trials, COARSE))
    residual = left(best[None])[:, 0]
    for width in _WIDTHS:
        trials = best + width * random.standard_normal((_NEARBY, *size))
        best, residual = _best([best, *trials], np.c_[residual, left(trials)])
    return np.asarray(typical * _descended(best, residual, left))


def _descended(
    best: FloatArray, residual: FloatArray, left: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Return a start (2, n) some steps of least squares further.

    Args:
        best: where to begin, as shares of what is typical.
        residual: (R,) what it leaves.
        left: starts (B, 2, n) -> what they leave (R, B).
    """
    varied = _VARIED * np.eye(best.size).reshape(-1, *best.shape)
    for _ in range(_STEPS):
        slopes = (left(best + varied) - residual[:, None]) / _VARIED
        if not np.isfinite(slopes).all():
            break
        whole = -np.linalg.lstsq(slopes, residual, rcond=1e-3)[0]
        promised = np.sum(residual**2) - np.sum((residual + slopes @ whole) ** 2)
        if promised <= _PROMISED * np.sum(residual**2):
            break
        step = whole.reshape(best.shape)
        trials = np.array([best + length * step for length in _LENGTHS])
        before = best
        best, residual = _best([best, *trials], np.c_[residual, left(trials)])
        if best is before:
            break
    return best


def _best(
    trials: Sequence[FloatArray] | FloatArray, left: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the trial that leaves least and what it leaves (R,), of (R, B)."""
    k = int(np.argmin(np.nan_to_num(np.sum(left**2, axis=0), nan=np.inf)))
    return trials[k], left[:, k]


def _typical(links: DrivenLinks, gears: Sequence[Flanks]) -> FloatArray:
    """Return deflections and rates (2, n) as large as a gear's play and wind-up allow."""
    load, inertia = np.abs(links.load[0]), np.diagonal(links.inertia[0])
    stiffness = np.array([max(gear.stiffness, 1e-9) for gear in gears])
    half = np.array([0.5 * gear.play for gear in gears])
    away = half + load / stiffness
    fall = np.sqrt(2.0 * load * away / inertia)
    return np.stack([away, fall])


def _left(responses: Sequence[LinkResponse], torques: FloatArray) -> FloatArray:
    """Return (R, B) what torques of the first moments (count, n, B) leave.

    After these moments, of which the filter sees as much again, all beginnings are taken to agree.
    """
    count, found = len(torques), []
    for k, response in enumerate(responses):
        seen = np.zeros((min(2 * count, len(response.unexplained)), torques.shape[-1]))
        seen[:count] = response.unexplained[:count, None] - torques[:, k]
        found.append(response.band(seen))
    return np.concatenate(found)
