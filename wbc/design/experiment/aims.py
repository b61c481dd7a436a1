"""What a motion is to make large, and the slopes of it in what is read of the torques."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from wbc.arrays import FloatArray
from wbc.design.experiment.rivals import Pair, Predictions

_SOFT = 10.0
"""Power of the mean that stands for the smallest of several odds where slopes are needed: the
smallest itself has none where two are equal."""


@dataclass(eq=False)
class Pulls:
    """Slopes of an aim in what is read of the torques of rivals, over noise.

    Attributes:
        torque: number of a cause -> (N m,), in its torque at the values expected.
        sensitivity: number of a cause -> (N m, p), in `Predictions.sensitivity`.
    """

    torque: dict[int, FloatArray] = field(default_factory=dict)
    sensitivity: dict[int, FloatArray] = field(default_factory=dict)

    def add(self, other: Pulls, weight: float) -> None:
        """Add the slopes of another aim times a weight."""
        for mine, theirs in ((self.torque, other.torque), (self.sensitivity, other.sensitivity)):
            for number, slope in theirs.items():
                mine[number] = mine.get(number, 0.0) + weight * slope


Climbed = Callable[[Predictions, Sequence[Pair]], tuple[float, Pulls]]
"""A number that a motion is to make large, with its slopes."""


@dataclass(frozen=True)
class Aim:
    """A number that a motion is to make large, given the pairs that a motion can tell apart.

    Attributes:
        value: of a motion's predictions.
        climbed: what is climbed instead, with its slopes; None where only changes at random help.
            It grows where `value` does, but may be a smooth function of it.
    """

    value: Callable[[Predictions, Sequence[Pair]], float]
    climbed: Climbed | None = None

    def __call__(self, found: Predictions, pairs: Sequence[Pair]) -> float:
        """Return the number."""
        return self.value(found, pairs)


def _least_odds(found: Predictions, pairs: Sequence[Pair]) -> float:
    if not pairs:
        return _narrowness(found, pairs)
    return min(found.near_distance(pair) for pair in pairs)


def _soft_least_odds(found: Predictions, pairs: Sequence[Pair]) -> tuple[float, Pulls]:
    """Return the logarithm of a mean of the odds that is near the smallest, and its slopes."""
    if not pairs:
        return _narrowness_slopes(found, pairs)
    parts = [distance_pulls(found, pair) for pair in pairs]
    size = np.log(np.maximum([value for value, _ in parts], 1e-12))
    share = np.exp(_SOFT * (size.min() - size))
    soft = size.min() - np.log(np.sum(share)) / _SOFT
    pulls = Pulls()
    for (_, one), weight in zip(parts, share / np.sum(share) / np.exp(size), strict=True):
        pulls.add(one, float(weight))
    return float(soft), pulls


def distance_pulls(found: Predictions, pair: Pair) -> tuple[float, Pulls]:
    """Return `Predictions.near_distance` and its slopes.

    With values z of the true cause and y of the rival, the distance is the least of
    1/2 |r + A z - B y|^2 + 2 |z|^2 beside a determinant. Where a least is taken, the slopes are
    those at fixed z and y.
    """
    true, other = pair
    apart = found.apart(pair)
    count = len(apart)
    held, root = _held(found, other)
    whole = np.concatenate([apart, np.zeros(len(held) - count)])
    pulls, spread = Pulls(), found.rivals.open_part(true)
    if spread is None:
        fit = np.linalg.lstsq(held, whole)[0]
        left = (whole - held @ fit)[:count]
        value = float(0.5 * np.sum((whole - held @ fit) ** 2))
    else:
        moves = np.zeros((len(held), spread.shape[1]))
        moves[:count] = found.sensitivity(true) @ spread
        both = np.column_stack([whole, moves])
        fits = np.linalg.lstsq(held, both)[0]
        rest = both - held @ fits
        gram, lever = rest[:, 1:].T @ rest[:, 1:], rest[:, 1:].T @ rest[:, 0]
        one = np.eye(len(gram))
        z = np.linalg.solve(4.0 * one + gram, lever)
        end = rest[:, 0] - rest[:, 1:] @ z
        fit, left = fits[:, 0] - fits[:, 1:] @ z, end[:count]
        grown = float(np.linalg.slogdet(one + 0.25 * gram)[1])
        value = float(0.5 * end @ end + 2.0 * z @ z + 2.0 * grown)
        # The determinant: d log det(1 + G/4) = 1/2 tr[(1 + G/4)^-1 M' dM].
        wide = rest[:, 1:] @ np.linalg.inv(one + 0.25 * gram)
        slope = (wide[:count] - np.outer(left, z)) @ spread.T
        pulls.add(Pulls({}, {true: slope}), 1.0)
        pulls.add(Pulls({}, {other: -(wide @ fits[:, 1:].T)[:count] @ root.T}), 1.0)
    pulls.add(Pulls({true: left}, {other: -np.outer(left, fit) @ root.T}), 1.0)
    pulls.add(Pulls({other: -left}), 1.0)
    return value, pulls


def _held(found: Predictions, number: int) -> tuple[FloatArray, FloatArray]:
    """Return what a rival can do (N m [+ p], p), and how its columns come from sensitivities."""
    spread, slopes = found.rivals.open_part(number), found.sensitivity(number)
    if spread is None:
        return slopes, np.eye(slopes.shape[1])
    return np.concatenate([slopes @ spread, np.eye(len(spread))]), spread


def _information(found: Predictions, pairs: Sequence[Pair]) -> float:
    return found.information()


def _information_slopes(found: Predictions, pairs: Sequence[Pair]) -> tuple[float, Pulls]:
    parts = [found.sensitivity(number) for number in range(len(found.rivals.causes))]
    columns = np.concatenate(parts, axis=1)
    known = np.eye(columns.shape[1]) + columns.T @ columns
    slope = 2.0 * np.linalg.solve(known, columns.T).T
    ends = np.cumsum([0, *(part.shape[1] for part in parts)])
    shares = {k: np.asarray(slope[:, ends[k] : ends[k + 1]]) for k in range(len(parts))}
    return found.information(), Pulls({}, shares)


def _narrowness(found: Predictions, pairs: Sequence[Pair]) -> float:
    widths = [found.widths(number) for number in range(len(found.rivals.causes))]
    return -float(np.mean(np.log(np.concatenate(widths))))


def _narrowness_slopes(found: Predictions, pairs: Sequence[Pair]) -> tuple[float, Pulls]:
    """d(-log width_i) = (C e_i)' S' dS (C e_i) / C_ii, with C the inverse of 1 + S' S."""
    shares: dict[int, FloatArray] = {}
    for number in range(len(found.rivals.causes)):
        slopes = found.sensitivity(number)
        spread = np.linalg.inv(np.eye(slopes.shape[1]) + slopes.T @ slopes)
        shares[number] = slopes @ (spread / np.diag(spread)) @ spread
    count = sum(slope.shape[1] for slope in shares.values())
    even: dict[int, FloatArray] = {k: np.asarray(slope / count) for k, slope in shares.items()}
    return _narrowness(found, pairs), Pulls({}, even)


deciding = Aim(_least_odds, _soft_least_odds)
"""The experiment that decides: the smallest expected log-odds; `shrinking` for one cause alone."""

informing = Aim(_information, _information_slopes)
"""A D-optimal experiment."""

shrinking = Aim(_narrowness, _narrowness_slopes)
"""Narrow intervals: minus the mean logarithm of their widths.

The motion with the smallest geometric mean of relative widths, whatever widths they are relative to
and whatever the units: each number counts, and halving any of them is worth the same. A median of
relative widths would let the wider half of the numbers go: climbing it for the shin of the sample
leg takes the middle one of three from 0.52 to 0.47 of a random motion's width, and the mass from
0.62 to 0.81."""
