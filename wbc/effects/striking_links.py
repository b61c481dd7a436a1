"""Links behind gears with play that shake one another, driven by their motors' motion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.coupled_links import CoupledLinks
from wbc.effects.flanks import COARSE, FINEST, START, Contact
from wbc.robot import LinkResponse

_BEGINNINGS = 32  # drawn at first ...
_NEARBY = 16  # ... and around the best of them, in rounds ...
_WIDTHS = (0.3, 0.1)  # ... of these widths, as shares of what is typical
_STEPS = 3  # of least squares at the end ...
_LENGTHS = (1.0, 0.4, 0.1)  # ... of which shares are tried
_VARIED = 1e-3  # of what is typical, for derivatives
_BEYOND = 1.3  # of a gear's wind-up under its load: how far a link may begin from the middle


def struck_deflections(
    responses: Sequence[LinkResponse], contacts: Sequence[Contact]
) -> list[FloatArray]:
    """Return the deflection of every link (N, 3): position, rate, second derivative.

    inertia d_dd + drag d_d + pull d + load = -k dz(d) - c d_d while in contact, for all gears at
    once: a link that strikes its flank throws the others through the off-diagonal inertia. A gear
    without play is a spring. Where a link has dry friction, that is a fourth column. Where in
    their play the links began, and how fast, is in no channel: it is chosen by what the first
    moments of the log leave unexplained.

    Args:
        responses: of the n links along one log, under the same load.
        contacts: the flanks of their gears.
    """
    links = CoupledLinks.of(responses)
    # Where the links of a trial fly off, so do its numbers: it leaves infinity, and loses.
    with np.errstate(over="ignore", invalid="ignore"):
        start = _beginning(responses, links, contacts)
    d, v, dry = links.follow(contacts, start)
    found = []
    for k, response in enumerate(responses):
        # Averaged over the two neighbouring intervals, so that it belongs to the sample's time.
        columns = [d[:, k], v[:, k], np.gradient(v[:, k], response.step)]
        if response.friction is not None:
            columns.append(np.convolve(dry[:, k], (0.5, 0.5))[: len(dry)])
        found.append(np.stack(columns, axis=1))
    return found


def _beginning(
    responses: Sequence[LinkResponse], links: CoupledLinks, contacts: Sequence[Contact]
) -> FloatArray:
    """Return deflections and rates (2, n) with which the log began.

    Links that strike follow no gradient far: beginnings are drawn, then others around the best,
    from which it is a short way. The same are drawn every time, so that what is left depends on
    the gears alone.
    """
    first = links.part(slice(0, int(START / links.step)))
    typical = _typical(links, contacts)
    random = np.random.default_rng(0)
    size = (2, len(contacts))

    def left(trials: FloatArray, finest: float = FINEST) -> FloatArray:
        return _left(responses, first.torques(contacts, typical * trials, finest))

    # In the middle, touching a flank, or wound up against it.
    touching = 0.5 * np.array([contact.play for contact in contacts]) / typical[0]
    places = [sorted({-1.0, -float(t), 0.0, float(t), 1.0}) for t in touching]
    sides = np.array(list(product(*places)))
    drawn = random.uniform(-_BEYOND, _BEYOND, (_BEGINNINGS, *size))
    trials = np.concatenate([np.stack([sides, 0.0 * sides], axis=1), drawn])
    best, _ = _best(trials, left(trials, COARSE))
    residual = left(best[None])[:, 0]
    for width in _WIDTHS:
        trials = best + width * random.standard_normal((_NEARBY, *size))
        best, residual = _best([best, *trials], np.c_[residual, left(trials)])
    varied = _VARIED * np.eye(best.size).reshape(-1, *size)
    for _ in range(_STEPS):
        slopes = (left(best + varied) - residual[:, None]) / _VARIED
        if not np.isfinite(slopes).all():
            break
        step = -np.linalg.lstsq(slopes, residual, rcond=1e-3)[0].reshape(size)
        trials = np.array([best + length * step for length in _LENGTHS])
        before = best
        best, residual = _best([best, *trials], np.c_[residual, left(trials)])
        if best is before:
            break
    return np.asarray(typical * best)


def _best(
    trials: Sequence[FloatArray] | FloatArray, left: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the trial that leaves least and what it leaves (R,), of (R, B)."""
    k = int(np.argmin(np.nan_to_num(np.sum(left**2, axis=0), nan=np.inf)))
    return trials[k], left[:, k]


def _typical(links: CoupledLinks, contacts: Sequence[Contact]) -> FloatArray:
    """Return deflections and rates (2, n) as large as a gear's play and wind-up allow."""
    load, inertia = np.abs(links.load[0]), np.diagonal(links.inertia[0])
    stiffness = np.array([max(contact.stiffness, 1e-9) for contact in contacts])
    half = np.array([0.5 * contact.play for contact in contacts])
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
