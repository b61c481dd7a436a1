"""Which causes a hypothesis may lose, by the derivatives of its fit: no model is fitted for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.identification.choice.evidence import log_densities
from wbc.identification.choice.hypothesis import Hypothesis, fold_means, without
from wbc.identification.choice.prior import asked
from wbc.identification.model.fit import Fit
from wbc.identification.model.problem import Problem
from wbc.robot import Effect


def losses(
    problem: Problem, fit: Fit, h: Hypothesis, drops: Sequence[Sequence[Effect]]
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
    return [_loss(problem, fit, h, stays, dropped) for dropped in drops]


def _loss(
    problem: Problem, fit: Fit, h: Hypothesis, stays: Hypothesis, dropped: Sequence[Effect]
) -> tuple[float, float]:
    keys = {effect.key for effect in dropped}
    gone = np.array([fit.effects[k].key in keys for k, _ in fit.parameters], dtype=bool)
    moved = fit.residual + fit.jacobian @ _without(problem, fit, gone)
    left = replace(_as_left(problem, h, moved), effects=without(h.effects, *dropped))
    here, there = log_densities(problem, [stays, left]).sum(axis=1)
    cheaper = asked(h.effects) - asked(left.effects)
    for effect, cost in zip(h.effects, h.implausible, strict=True):
        cheaper += cost * (effect.key in keys)
    return float(here - there), float(cheaper)


def _without(problem: Problem, fit: Fit, gone: BoolArray) -> FloatArray:
    """Return the step (p,) after which some parameters say nothing, the others fitted again."""
    step = np.zeros(len(fit.parameters))
    for row in np.flatnonzero(gone):
        k, parameter = fit.parameters[row]
        effect = fit.effects[k]
        if not parameter.shape:
            nulls = effect.null_values(problem.robot, effect.where)
            null = nulls.get(parameter.name, parameter.null)
            step[row] = (null - effect.values[parameter.name]) / parameter.scale
    a = (fit.jacobian * fit.usual.weights[:, None]).reshape(-1, step.size)
    gram, moment = a.T @ a, a.T @ (fit.residual * fit.usual.weights).ravel()
    if fit.usual.residual.size:
        gram += fit.usual.jacobian.T @ fit.usual.jacobian
        moment += fit.usual.jacobian.T @ fit.usual.residual
    kept = np.flatnonzero(~gone)
    if kept.size:
        right = -(moment[kept] + gram[np.ix_(kept, np.flatnonzero(gone))] @ step[gone])
        step[kept] = np.linalg.lstsq(gram[np.ix_(kept, kept)], right, rcond=1e-9)[0]
    return step


def _as_left(problem: Problem, h: Hypothesis, residual: FloatArray) -> Hypothesis:
    """Return the hypothesis as if it left this residual (rows, outputs), nothing held out."""
    return replace(h, folds=fold_means(problem.folds, residual**2))
