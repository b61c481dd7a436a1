"""Links behind gears with play that shake one another, driven by their motors' motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import product

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.flanks import (
    COARSE,
    FINEST,
    START,
    Contact,
    steps_per_sample,
    weight_of_the_end,
)
from wbc.robot import LinkFriction, LinkResponse

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
    links = _Links.of(responses)
    d, v, dry = links.follow(contacts, _beginning(responses, links, contacts))
    found = []
    for k, response in enumerate(responses):
        # Averaged over the two neighbouring intervals, so that it belongs to the sample's time.
        columns = [d[:, k], v[:, k], np.gradient(v[:, k], response.step)]
        if response.friction is not None:
            columns.append(np.convolve(dry[:, k], (0.5, 0.5))[: len(dry)])
        found.append(np.stack(columns, axis=1))
    return found


def _beginning(
    responses: Sequence[LinkResponse], links: _Links, contacts: Sequence[Contact]
) -> FloatArray:
    """Return deflections and rates (2, n) with which the log began.

    Links that strike follow no gradient far: beginnings are drawn, then others around the best,
    from which it is a short way. The same are drawn every time, so that what is left depends on
    the gears alone.
    """
    first = links.part(min(len(links.load), int(START / links.step)))
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


def _typical(links: _Links, contacts: Sequence[Contact]) -> FloatArray:
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


@dataclass(frozen=True, eq=False)
class _Links:
    """What drives n links along a log, (N, n, n) and (N, n), and the distance of samples [s]."""

    inertia: FloatArray
    drag: FloatArray
    pull: FloatArray
    load: FloatArray
    speed: FloatArray
    level: FloatArray
    counted: FloatArray
    step: float

    @classmethod
    def of(cls, responses: Sequence[LinkResponse]) -> _Links:
        rows, nothing = [r.row for r in responses], np.zeros(len(responses[0].load))

        def coupled(name: str) -> FloatArray:
            return np.stack([getattr(r, name)[:, rows] for r in responses], axis=-1)

        def rubbing(name: str) -> FloatArray:
            without = LinkFriction(nothing, nothing, nothing)
            return np.stack([getattr(r.friction or without, name) for r in responses], axis=1)

        return cls(
            *(coupled("inertia"), coupled("damping"), coupled("stiffness")),
            responses[0].load[:, rows],
            *(rubbing("velocity"), rubbing("level"), rubbing("counted")),
            responses[0].step,
        )

    @cached_property
    def least_inertia(self) -> FloatArray:
        """What each link (n,) weighs on its flank where all others are free to give way."""
        freedom = np.diagonal(np.linalg.inv(self.inertia), axis1=1, axis2=2)
        return np.asarray(1.0 / np.max(freedom, axis=0))

    def part(self, count: int) -> _Links:
        """Return the first `count` samples."""
        names = (f.name for f in fields(self) if f.name != "step")
        return replace(self, **{name: getattr(self, name)[:count] for name in names})

    def follow(
        self, contacts: Sequence[Contact], start: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return deflections, rates and dry friction (N, n) from a start (2, n)."""
        from wbc.effects.striking_steps import follow_striking  # it loads the compiler

        d, v, dry = np.zeros((3, *self.load.shape))
        d[0], v[0] = start
        links = self.inertia, self.drag, self.pull, self.load, self.speed, self.level
        follow_striking(*links, *self._steps(contacts, FINEST), d, v, dry)
        return d, v, dry

    def torques(self, contacts: Sequence[Contact], starts: FloatArray, finest: float) -> FloatArray:
        """Return additional torques (N, n, B) from starts (B, 2, n)."""
        from wbc.effects.striking_steps import rank_striking  # it loads the compiler

        torques = np.zeros((*self.load.shape, len(starts)))
        links = self.inertia, self.drag, self.pull, self.load, self.speed, self.level
        rank_striking(*links, self.counted, *self._steps(contacts, finest), starts, torques)
        return torques

    def _steps(
        self, contacts: Sequence[Contact], finest: float
    ) -> tuple[float, int, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return samples' distance, steps per sample, theta, and the flanks' numbers (n,)."""
        stiffness, damping, play = (
            np.array([getattr(contact, name) for contact in contacts], dtype=float)
            for name in ("stiffness", "damping", "play")
        )
        pairs = list(zip(stiffness, self.least_inertia, strict=True))
        parts = max(steps_per_sample(self.step, k, m, finest) for k, m in pairs)
        h = self.step / parts
        late = np.array([float(weight_of_the_end(np.array(k), m, h)) for k, m in pairs])
        return self.step, parts, late, stiffness, damping, 0.5 * play
