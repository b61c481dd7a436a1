"""Which causes a hypothesis may lose, by derivatives: no model is fitted for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.choice.evidence import Hypothesis, Key, asked, density_gained, without
from wbc.identification.model.columns import change_along
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit, scaled
from wbc.robot import Effect, Robot


class Normal(NamedTuple):
    """The minimum of a quadratic form, with some of its numbers given.

    Attributes:
        covariance: (p, p) inverse of the normal matrix, in units of `size`.
        lowest: (p,) step to the minimum, likewise.
        size: (p,) of the numbers.
    """

    covariance: FloatArray
    lowest: FloatArray
    size: FloatArray

    @classmethod
    def of(cls, gram: FloatArray, moment: FloatArray) -> Normal:
        """Return the minimum of normal equations (p, p) and (p,)."""
        known, size = scaled(gram)
        size = np.where(np.diagonal(gram) > 0.0, size, 1.0)  # a column of zeros may have any step
        return cls.in_units(known, moment / size, size)

    @classmethod
    def in_units(cls, known: FloatArray, moment: FloatArray, size: FloatArray) -> Normal:
        """Return the minimum of normal equations in units of the sizes (p,) of the numbers."""
        covariance = np.linalg.inv(known)
        return cls(np.asarray(covariance), -(covariance @ moment), size)

    def step_with(self, given: Sequence[int], steps: FloatArray) -> FloatArray:
        """Return the step (p,) to the minimum with given steps.

        With C the covariance, n the step to the minimum and s the steps of the numbers g that are
        given, it is  n + C_:g C_gg^-1 (s - n_g).
        """
        rows = list(given)
        lacking = steps * self.size[rows] - self.lowest[rows]
        pulled = np.linalg.solve(self.covariance[np.ix_(rows, rows)], lacking)
        return np.asarray((self.lowest + self.covariance[:, rows] @ pulled) / self.size)

    def covariance_with(self, given: Sequence[int]) -> FloatArray:
        """Return the covariance (p, p) beside given numbers g:  C - C_:g C_gg^-1 C_g:."""
        rows = list(given)
        along = self.covariance[:, rows]
        told = np.linalg.solve(self.covariance[np.ix_(rows, rows)], along.T)
        return np.asarray((self.covariance - along @ told) / np.outer(self.size, self.size))


def losses(
    problem: EstimationProblem, fit: Fit, h: Hypothesis, drops: Sequence[Sequence[Effect]]
) -> list[tuple[float, float]]:
    """Return what each drop loses of the log density, and gains of the log prior [nats].

    The fit's own derivatives say to first order what is left without the causes once all others
    have taken up what they can.

    Args:
        problem: the logs.
        fit: of the hypothesis.
        h: the hypothesis.
        drops: causes that are dropped together.
    """
    here = np.mean(fit.residual**2, axis=0)
    found = []
    for dropped, residual in zip(drops, without_each(problem, fit, drops), strict=True):
        left = np.mean(residual**2, axis=0)[None]
        (gain,) = density_gained(problem, h, here, left, h.samples).tolist()
        found.append((-gain, cheaper(h, dropped, ())))
    return found


@dataclass(frozen=True, eq=False)
class Drops:
    """What a fit leaves more of data that it has not seen, without some of its causes.

    To first order; of a cause that derivatives do not follow a fit without it tells.

    Attributes:
        problem: the logs.
        fit: of a hypothesis.
        fitted: (outputs,) mean squares more, by name and place, where a fit tells them.
        folds: what all other folds tell of the numbers, and the products of each fold: (outputs, p,
            p) and (outputs, p) of derivatives, along with one another and with what is left there,
            and (outputs,) squares of that.
    """

    problem: EstimationProblem
    fit: Fit
    fitted: Mapping[Key, FloatArray]
    folds: tuple[tuple[Normal, FloatArray, FloatArray, FloatArray], ...]
    _known: dict[frozenset[Key], FloatArray] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: EstimationProblem, fit: Fit, fitted: Mapping[Key, FloatArray]) -> Drops:
        """Return what is needed for all drops."""
        folds = []
        for rows, gram, moment in fit.without_each():
            known, along, norm = fit.beside_usual(gram, moment)
            size = np.where(np.isfinite(norm), norm, 1.0)  # a column of zeros may have any step
            sums = sums_by_output(fit.jacobian[rows].transpose(1, 2, 0), fit.residual[rows].T)
            folds.append((Normal.in_units(known, along, size), *sums))
        return cls(problem, fit, fitted, tuple(folds))

    def without(self, keys: frozenset[Key]) -> FloatArray:
        """Return (outputs,) mean squares more, in floors."""
        gone = keys.difference(self.fitted)
        more = np.maximum(self._left(gone) - self._left(frozenset()), 0.0)
        return np.asarray(more + sum(self.fitted[key] for key in keys.intersection(self.fitted)))

    def _left(self, keys: frozenset[Key]) -> FloatArray:
        if keys not in self._known:
            own = [effect for effect in self.fit.effects if effect.key in keys]
            gone = until_null(self.fit, own, self.problem.robot)
            squares = np.zeros(self.fit.residual.shape[1])
            for lowest, gram, moment, left in self.folds:
                step = lowest.step_with(*gone)
                squares += left + 2.0 * moment @ step + step @ gram @ step
            self._known[keys] = squares / len(self.fit.residual)
        return self._known[keys]


def sums_by_output(
    derivatives: FloatArray, left: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (outputs, p, p), (outputs, p), (outputs,) products of derivatives and what is left.

    Args:
        derivatives: (outputs, p, rows).
        left: (outputs, rows).
    """
    moment = (derivatives @ left[:, :, None])[:, :, 0]
    return derivatives @ derivatives.swapaxes(1, 2), moment, np.sum(left**2, axis=1)


def without_each(
    problem: EstimationProblem, fit: Fit, drops: Sequence[Sequence[Effect]]
) -> Iterator[FloatArray]:
    """Yield what is left (rows, outputs) without the causes of each drop."""
    lowest = Normal.of(fit.known, fit.moment)
    for dropped in drops:
        step = lowest.step_with(*until_null(fit, dropped, problem.robot))
        yield fit.residual + change_along(fit.jacobian, step)


def until_null(fit: Fit, own: Sequence[Effect], robot: Robot) -> tuple[list[int], FloatArray]:
    """Return the parameters of some causes, and how far each is from not being there.

    Args:
        fit: with the causes.
        own: the causes.
        robot: that lacks them.

    Returns:
        Numbers of their parameters among those of the fit; steps in the scales of these.
    """
    keys = {effect.key for effect in own}
    gone, steps = [], []
    for row, (k, parameter) in enumerate(fit.parameters):
        effect = fit.effects[k]
        if effect.key not in keys:
            continue
        null = effect.null_of(robot, parameter)
        change = 0.0 if parameter.shape else (null - effect.values[parameter.name])
        gone.append(row)
        steps.append(change / parameter.scale)
    return gone, np.array(steps)


def cheaper(h: Hypothesis, dropped: Sequence[Effect], added: Sequence[Effect]) -> float:
    """Return what the log prior gains where causes of a hypothesis give way to others [nats].

    Args:
        h: the hypothesis.
        dropped: its causes that give way.
        added: new ones, with plausible numbers.
    """
    rest = without(h.effects, *dropped)
    kept = {effect.key for effect in rest}
    saved = sum(cost for key, cost in zip(h.keys, h.implausible, strict=True) if key not in kept)
    untold = sum(own for key, own in zip(h.keys, h.untold, strict=True) if key in kept)
    return h.asked - asked((*rest, *added), untold) + saved
