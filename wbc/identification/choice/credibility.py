"""Whether fitted numbers are an explanation at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.yielding_gear import YieldingGear
from wbc.identification.model.fit import Fit
from wbc.identification.model.intervals import bootstrap_steps, interval_bounds
from wbc.identification.model.problem import ONLY_NOISE, Problem
from wbc.identification.model.residual import drive_gains, drive_misses
from wbc.identification.records.folds import ROWS_PER_SAMPLE

_FOLLOWED = 0.3  # share of the needed torque that a drive model may miss and still be believed
_LEAST_MASS = 0.1  # of a link, that a payload of negative mass may leave
_DEVIATIONS = 5.0
_VAGUE = 0.1  # low over high of a shape that the logs leave open
_MOST_GAIN = 2.5  # of a drive: delivered over reported torque, or the inverse


def showing(problem: Problem, fit: Fit) -> set[int]:
    """Return the numbers of the effects with a parameter whose interval leaves out its null value.

    A cause that helps each log with another value of its own is none that the logs share. Where
    nothing but noise is left, its known size may tell more than the few blocks of a short log.
    """
    sure = _sure(problem, fit)
    bounds = interval_bounds(fit, problem.blocks, np.zeros(1))
    held = _with_vague_shapes_held(problem, fit, bounds)
    seen = set()
    pairs = zip(fit.parameters, bounds, held, sure, strict=True)
    for (k, parameter), (low, high), (held_low, held_high), deviation in pairs:
        effect = fit.effects[k]
        null = effect.null_values(problem.robot, effect.where)[parameter.name]
        away = abs(effect.values[parameter.name] - null) / parameter.scale
        inside = low <= null <= high and held_low <= null <= held_high
        if not parameter.shape and (not inside or away > _DEVIATIONS * deviation):
            seen.add(k)
    return seen


def _with_vague_shapes_held(problem: Problem, fit: Fit, bounds: FloatArray) -> FloatArray:
    """Return the bounds (p, 2) with those shapes held that the logs leave open by a decade.

    Which of two numbers a short log leaves open (how fast a motor weakens, and for how long) is no
    reason to doubt both.
    """
    vague = [
        parameter.shape and 0.0 < low <= _VAGUE * high
        for (_, parameter), (low, high) in zip(fit.parameters, bounds, strict=True)
    ]
    if not any(vague):
        return bounds
    free = np.flatnonzero(~np.array(vague))
    parameters = tuple(fit.parameters[row] for row in free)
    known = replace(fit, jacobian=fit.jacobian[..., free], parameters=parameters)
    held = bounds.copy()
    held[free] = interval_bounds(known, problem.blocks, np.zeros(1))
    return held


def _sure(problem: Problem, fit: Fit) -> FloatArray:
    """Return the deviations (p,) of the parameters, in scales, that noise of known size allows.

    Infinite where more than noise is left.
    """
    count = len(fit.parameters)
    if not count or np.mean(problem.held_out(fit)) > ONLY_NOISE:
        return np.full(count, np.inf)
    a = fit.jacobian.reshape(-1, count)
    norm = np.maximum(np.sqrt(np.sum(a**2, axis=0)), 1e-300)
    gram = (a / norm).T @ (a / norm) + 1e-9 * np.eye(count)
    return np.asarray(np.sqrt(ROWS_PER_SAMPLE * np.diag(np.linalg.inv(gram))) / norm)


def shape_at_bound(fit: Fit) -> bool:
    """Whether a shape lies at the end of its range, where an effect often turns into a simpler."""
    found = ((fit.effects[k].values[p.name], p) for k, p in fit.parameters if p.shape)
    return any(value in (p.low, p.high) for value, p in found)


def at_the_end(fit: Fit) -> dict[int, float]:
    """Return the rows of parameters at the end of their range, 1 at the upper and -1 at the lower.

    Shapes do not count: an effect at the end of its shapes often turns into a simpler one.
    """
    values = [fit.effects[k].values[parameter.name] for k, parameter in fit.parameters]
    return {
        row: 1.0 if value == parameter.high else -1.0
        for row, ((_, parameter), value) in enumerate(zip(fit.parameters, values, strict=True))
        if not parameter.shape and value in (parameter.low, parameter.high)
    }


def pushes_out(problem: Problem, fit: Fit) -> bool:
    """Whether noise cannot be why a number of what was added last lies at the end of its range.

    What was there before may have become idle by it, and be dropped.
    """
    newest = fit.effects[-1].name if fit.effects else ""
    ends = {
        row: side
        for row, side in at_the_end(fit).items()
        if fit.effects[fit.parameters[row][0]].name == newest
    }
    if not ends:
        return False
    steps = bootstrap_steps(fit, problem.blocks)
    return any(np.percentile(side * steps[:, row], 1.0) > 0.0 for row, side in ends.items())


def credible(problem: Problem, fit: Fit) -> bool:
    """Whether no number lies at the end of a fit's range, and no drive or mass explains too much.

    A drive model that makes much more or much less of the reported torque would explain any
    channel that holds no torque; it is believed where what it delivers is what the motion needs.
    """
    for k, parameter in fit.parameters:
        effect = fit.effects[k]
        value = effect.values[parameter.name]
        null = effect.null_values(problem.robot, effect.where)[parameter.name]
        if not parameter.shape and value in (parameter.low, parameter.high) and value != null:
            return False
    # While more than noise is left, what is still missing may push.
    if np.mean(problem.held_out(fit)) <= ONLY_NOISE and pushes_out(problem, fit):
        return False
    motions = [record.motion for record in problem.records]
    if not all(effect.recognisable(fit.robot, motions) for effect in fit.effects):
        return False
    if not all(_plays(problem, e) for e in fit.effects if isinstance(e, YieldingGear)):
        return False
    before, after = (
        np.array([i.mass for i in r.model.inertias]) for r in (problem.robot, fit.robot)
    )
    if np.any(after < _LEAST_MASS * before):
        return False
    gains = drive_gains(fit.robot, problem.records)
    inside = (gains > 1.0 / _MOST_GAIN) & (gains < _MOST_GAIN)
    if inside.all():
        return True
    return bool(np.all(inside | (drive_misses(fit.robot, problem.records) < _FOLLOWED)))


def _plays(problem: Problem, gear: YieldingGear) -> bool:
    """Whether a gear is no spring that is taken for play between soft flanks."""
    contact, row = gear.contact(), problem.robot.velocity_index(gear.where)
    if contact.play == 0.0:
        return True
    loads = [record.links[:, row] - record.contacts[:, row] for record in problem.records]
    return contact.plays(max(float(np.max(np.abs(load))) for load in loads))
