"""Which causes a hypothesis may lose or exchange, by derivatives: no model is fitted for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.choice.evidence import Hypothesis, asked, fold_means, log_densities, without
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit, change_along, scaled
from wbc.robot import Effect, Robot


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
    stays = _as_left(problem, h, fit.residual)
    found = []
    for dropped, residual in zip(drops, without_each(problem, fit, drops), strict=True):
        moved = _as_left(problem, h, residual)
        left = replace(moved, effects=without(h.effects, *dropped))
        here, there = log_densities(problem, [stays, left]).sum(axis=1)
        found.append((float(here - there), _cheaper(h, dropped, left.effects)))
    return found


def exchanged(
    problem: EstimationProblem,
    fit: Fit,
    h: Hypothesis,
    own: Sequence[Effect],
    columns: FloatArray,
    effects: Sequence[Effect],
) -> tuple[float, float]:
    """Return what causes in the place of others gain of the log density and of the prior [nats].

    To first order, nothing held out, and without what implausible numbers of the new ones cost.

    Args:
        problem: the logs.
        fit: of the hypothesis.
        h: the hypothesis.
        own: its causes that give way; none where others stand beside all.
        columns: (rows, judged outputs, r) by which each number of the new ones changes residuals.
        effects: what the hypothesis then holds.
    """
    felt = np.flatnonzero(columns.any(axis=(0, 2)))
    columns, weight = columns[:, felt], 1.0 / fit.usual.noise[felt]
    gram, moment = fit.known, fit.moment
    weighted = (columns * weight[:, None]).reshape(-1, columns.shape[2])
    beside = fit.jacobian[:, felt].reshape(len(weighted), moment.size).T @ weighted
    among = columns.reshape(len(weighted), -1).T @ weighted
    along = fit.residual[:, felt].ravel() @ weighted
    normal = np.block([[gram, beside], [beside.T, among]]), np.concatenate([moment, along])
    (step,) = _steps(*_scaled(*normal), [until_null(fit, own, problem.robot)])
    residual = fit.residual + change_along(fit.jacobian, step[: moment.size])
    residual[:, felt] += columns @ step[moment.size :]
    stays = _as_left(problem, h, fit.residual)
    # What a cause more takes away may be all that was correlated.
    samples = h.samples if own else problem.white_samples
    left = replace(_as_left(problem, h, residual), effects=tuple(effects), samples=samples)
    here, there = log_densities(problem, [stays, left]).sum(axis=1)
    return float(there - here), _cheaper(h, own, effects)


def gains(
    problem: EstimationProblem, fit: Fit, drops: Sequence[Sequence[Effect]]
) -> list[FloatArray]:
    """Return (outputs,) what each drop adds to the held-out mean squares, to first order.

    Args:
        problem: the logs.
        fit: of a hypothesis.
        drops: causes that are dropped together.
    """
    gone = [([], np.zeros(0)), *(until_null(fit, own, problem.robot) for own in drops)]
    squares = np.zeros((len(gone), fit.residual.shape[1]))
    for rows, gram, moment in fit.without_each():
        known, along, norm = fit.beside_usual(gram, moment)
        size = np.where(np.isfinite(norm), norm, 1.0)  # a column of zeros may have any step
        for sums, step in zip(squares, _steps(known, along, size, gone), strict=True):
            left = fit.residual[rows] + change_along(fit.jacobian[rows], step)
            sums += np.einsum("ro,ro->o", left, left)
    means = squares / len(fit.residual)
    return list(means[1:] - means[0])


def without_each(
    problem: EstimationProblem, fit: Fit, drops: Sequence[Sequence[Effect]]
) -> Iterator[FloatArray]:
    """Yield what is left (rows, outputs) without the causes of each drop."""
    gone = [until_null(fit, dropped, problem.robot) for dropped in drops]
    for step in _steps(*_scaled(fit.known, fit.moment), gone):
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


def _cheaper(h: Hypothesis, dropped: Sequence[Effect], effects: Sequence[Effect]) -> float:
    """Return what the log prior gains where causes of a hypothesis are dropped [nats].

    Args:
        h: the hypothesis.
        dropped: its causes.
        effects: what it then holds; new ones have plausible numbers.
    """
    keys = {effect.key for effect in dropped}
    costs = zip(h.effects, h.implausible, strict=True)
    saved = sum(cost for effect, cost in costs if effect.key in keys)
    untold = dict(zip(h.keys, h.untold, strict=True))
    kept = sum(untold.get(effect.key, 0.0) for effect in effects)
    return h.asked - asked(effects, kept) + saved


def _scaled(gram: FloatArray, moment: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return normal equations in units of the parameters' sizes, and these."""
    known, size = scaled(gram)
    return known, moment / size, size


def _steps(
    known: FloatArray,
    moment: FloatArray,
    size: FloatArray,
    drops: Sequence[tuple[list[int], FloatArray]],
) -> list[FloatArray]:
    """Return the steps (p,) after which some parameters say nothing, the others fitted again.

    With C the inverse of the normal matrix, n the step to the minimum and s that of the parameters
    that go, it is  n + C_:g C_gg^-1 (s - n_g).

    Args:
        known: (p, p) normal matrix, in units of `size`.
        moment: (p,) likewise.
        size: (p,) of the parameters.
        drops: each the numbers g of the parameters, and their steps s.
    """
    covariance = np.linalg.inv(known)
    lowest = -(covariance @ moment)
    found = []
    for gone, steps in drops:
        lacking = steps * size[gone] - lowest[gone]
        own = covariance[np.ix_(gone, gone)]
        found.append((lowest + covariance[:, gone] @ np.linalg.solve(own, lacking)) / size)
    return found


def _as_left(problem: EstimationProblem, h: Hypothesis, residual: FloatArray) -> Hypothesis:
    """Return the hypothesis as if it left this residual (rows, outputs), nothing held out."""
    squares = fold_means(problem.folds, residual**2)
    return replace(h, folds=squares, beside=squares)
