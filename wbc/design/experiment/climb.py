"""Climbing from a motion along exact slopes of an aim, within the limits (barrier and BFGS)."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wbc.arrays import FloatArray
from wbc.design.experiment.aims import Climbed, Kinematics, motion_slopes
from wbc.design.experiment.motions import ROOM, SEARCH_RATE, FourierPath, Site
from wbc.design.experiment.rivals import Pair, Predictions

_HIGHEST = 2.0  # [Hz] of the highest harmonic
_BARRIERS = (0.1, 0.03)  # weights of the barrier, one after another
_LAST, _SMALL = 5, 1e-3  # steps, and their gain together below which a barrier is done with
_HALVINGS = 8  # of one step, before its direction is given up


def climbed_path(
    site: Site, path: FourierPath, climbed: Climbed, pairs: Sequence[Pair], torques: int
) -> FourierPath:
    """Return a path that is better by an aim, from one within the limits; the same every time.

    All coefficients up to `_HIGHEST` are free. The limits are a barrier mu mean log(1 - share)
    whose weight mu falls (Nocedal and Wright 2006, chapter 19), the steps are those of BFGS
    (chapter 6).

    Args:
        site: rivals for which `slopes_are_exact`, and limits.
        path: where to start.
        climbed: of the aim.
        pairs: that a motion can tell apart.
        torques: how many (N, m) torques may be evaluated at most.
    """
    hill = _Hill.of(site, path, climbed, pairs)
    here = hill.start(path)
    for stage, weight in enumerate(_BARRIERS):
        share = (torques - hill.spent) // (len(_BARRIERS) - stage)
        here = _ascend(hill, here, weight, hill.spent + share)
    return hill.path(here)


@dataclass(eq=False)
class _Hill:
    """The aim and the barrier over the free coefficients (2 m K,), sines first.

    Each coefficient is in units of one over its order: the speeds of all are alike then.
    """

    site: Site
    climbed: Climbed
    pairs: Sequence[Pair]
    frequency: float
    waves: tuple[FloatArray, FloatArray, FloatArray]  # (N, 2 K) of unit coefficients
    spent: int = field(default=0)

    @classmethod
    def of(cls, site: Site, path: FourierPath, climbed: Climbed, pairs: Sequence[Pair]) -> _Hill:
        # The first harmonic takes about the whole time, so that slow parts are free as well.
        parts = max(1, round(path.frequency * path.duration))
        frequency = path.frequency / parts
        count = max(int(_HIGHEST / frequency), parts * path.sine.shape[1])
        order = np.tile(np.arange(1, count + 1), 2)
        unit = np.diag(1.0 / order)
        each = FourierPath(
            np.zeros(2 * count), unit[:, :count], unit[:, count:], frequency, path.duration
        )
        return cls(site, climbed, pairs, frequency, each.at(path.times(SEARCH_RATE)))

    @property
    def _count(self) -> int:
        return int(self.waves[0].shape[1] // 2)

    def start(self, path: FourierPath) -> FloatArray:
        """Return the coefficients of a path, made a little smaller until no limit is reached."""
        parts = round(path.frequency / self.frequency)
        free = np.zeros((2, len(path.center), self._count))
        free[:, :, parts - 1 : parts * path.sine.shape[1] : parts] = path.sine, path.cosine
        here = (free * np.arange(1, self._count + 1)).ravel()
        while self.value(here, 1.0)[1] is None:
            here = 0.98 * here
        return here

    def path(self, here: FloatArray) -> FourierPath:
        """Return the path of coefficients."""
        free = here.reshape(2, -1, self._count) / np.arange(1, self._count + 1)
        center = self.site.limits.center
        return FourierPath(center, free[0], free[1], self.frequency, self.site.duration)

    def keeps_apart(self, here: FloatArray) -> bool:
        """Whether no links of the path come too near one another."""
        path = self.path(here)
        return self.site.limits.keeps_apart(path.at(path.times(SEARCH_RATE))[0])

    def value(self, here: FloatArray, weight: float) -> tuple[float, Predictions | None]:
        """Return the aim beside the barrier, and the predictions; minus infinity beyond a limit."""
        path = self.path(here)
        motion = path.at(path.times(SEARCH_RATE))
        kept = sum(_barrier(*one)[0] for one in self._bounds(motion))
        if not np.isfinite(kept):
            return -np.inf, None
        found = self.site.rivals.predictions(self.site.motion(path, SEARCH_RATE))
        self.spent += self.site.rivals.torque_count
        kept += sum(_barrier(torque, *self._torque_bounds)[0] for torque in _torques(found))
        if not np.isfinite(kept):
            return -np.inf, None
        return self.climbed(found, self.pairs)[0] + weight * kept, found

    def slope(self, here: FloatArray, weight: float, found: Predictions) -> FloatArray:
        """Return the slopes of `value` in all coefficients; its predictions are given."""
        path = self.path(here)
        motion = path.at(path.times(SEARCH_RATE))
        loads = [weight * _barrier(tau, *self._torque_bounds)[1] for tau in _torques(found)]
        _, pulls = self.climbed(found, self.pairs)
        parts = motion_slopes(found, pulls, {k - 1: load for k, load in enumerate(loads)})
        self.spent += 3 * len(path.center) * self.site.rivals.torque_count
        held = [weight * _barrier(*one)[1] for one in self._bounds(motion)]
        each = [
            wave.T @ (part + bend) for wave, part, bend in zip(self.waves, parts, held, strict=True)
        ]
        return np.asarray(sum(each)).reshape(2, self._count, -1).transpose(0, 2, 1).ravel()

    def _bounds(self, motion: Kinematics) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """Return moves from the centre, velocities and accelerations, each with its two bounds."""
        limits = self.site.limits
        sides = (
            (limits.low - limits.center, limits.high - limits.center),
            (-limits.speed, limits.speed),
            (-limits.acceleration, limits.acceleration),
        )
        moves = (motion[0] - limits.center, *motion[1:])
        return [(m, ROOM * low, ROOM * high) for m, (low, high) in zip(moves, sides, strict=True)]

    @property
    def _torque_bounds(self) -> tuple[FloatArray, FloatArray]:
        return -ROOM * self.site.limits.torque, ROOM * self.site.limits.torque


def _torques(found: Predictions) -> list[FloatArray]:
    return [found.torque(()), *map(found.expected_torque, range(len(found.rivals.causes)))]


def _barrier(values: FloatArray, low: FloatArray, high: FloatArray) -> tuple[float, FloatArray]:
    """Return the mean over rows of log (1 - x/low) (1 - x/high), and its slopes (N, m).

    Minus infinity where a bound is reached; low < 0 < high, infinite for none.
    """
    below, above = 1.0 - values / low, 1.0 - values / high
    if min(below.min(), above.min()) <= 0.0:
        return -np.inf, np.zeros(0)
    value = float(np.sum(np.log(below) + np.log(above)) / len(values))
    return value, (-1.0 / (low * below) - 1.0 / (high * above)) / len(values)


def _ascend(hill: _Hill, here: FloatArray, weight: float, end: int) -> FloatArray:
    """Return where the steps of BFGS lead before so many torques are spent."""
    value, found = hill.value(here, weight)
    if found is None:  # from the barrier before, whose room is the same
        return here
    slope = hill.slope(here, weight, found)
    inverse: FloatArray | None = None  # of the curvature downhill; None while nothing is known
    gained: deque[float] = deque(maxlen=_LAST)
    while hill.spent < end:
        length = 0.1 * float(np.linalg.norm(here)) / max(float(np.linalg.norm(slope)), 1e-300)
        step = length * slope if inverse is None else inverse @ slope
        reached = _first_better(hill, here, value, step, float(slope @ step), weight)
        if reached is None:
            if inverse is None:
                break
            inverse = None
            continue
        there, new, found = reached
        turned = hill.slope(there, weight, found)
        moved, fallen = there - here, slope - turned
        fall = float(moved @ fallen)
        if fall > 1e-10 * float(np.linalg.norm(moved) * np.linalg.norm(fallen)):
            one = np.eye(len(here))
            before = one * (fall / float(fallen @ fallen)) if inverse is None else inverse
            way = one - np.outer(moved, fallen) / fall
            inverse = way @ before @ way.T + np.outer(moved, moved) / fall
        gained.append(new - value)
        here, value, slope = there, new, turned
        if len(gained) == _LAST and sum(gained) < _SMALL:
            break
    return here


def _first_better(
    hill: _Hill, here: FloatArray, value: float, step: FloatArray, rise: float, weight: float
) -> tuple[FloatArray, float, Predictions] | None:
    """Return the first of a step and its halves that gains what it should (Armijo)."""
    for k in range(_HALVINGS):
        there = here + 0.5**k * step
        new, found = hill.value(there, weight)
        if found is not None and new >= value + 1e-4 * 0.5**k * rise and hill.keeps_apart(there):
            return there, new, found
    return None
