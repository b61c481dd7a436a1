"""How plausible a set of causes is before the logs speak."""

from __future__ import annotations

import numpy as np

from wbc.identification.choice.gears.plays import plays
from wbc.identification.model.fit import Fit
from wbc.identification.model.intervals import bootstrap_steps
from wbc.identification.model.problem import Problem
from wbc.identification.model.residual import drive_gains
from wbc.identification.model.yielding import yielding_gears
from wbc.transmission import Flanks

_NAME, _PLACE, _NUMBER = 6.0, 3.0, 1.0  # [nats] for each name, place and number of a hypothesis
_GAIN = 0.35  # standard deviation of the logarithm of delivered over reported torque
_LOST = 0.5  # ... of the logarithm of the share of a link's mass that is left
_BEYOND = 12.0  # [nats] for a number that the logs want beyond the end of its range
_AT_END = 3.0  # [nats] for one that lies there
_NOT_SHOWN = 15.0  # [nats] for an effect that these motions cannot show for what it is


def asked(fit: Fit) -> float:
    """Return what the names, places and numbers of a fitted set of causes cost [nats]."""
    names = {effect.name for effect in fit.effects}
    numbers = sum(effect.freedom for effect in fit.effects)
    return _NAME * len(names) + _PLACE * len(fit.effects) + _NUMBER * numbers


def implausible(problem: Problem, fit: Fit) -> float:
    """Return what fitted numbers cost that no machine is likely to have [nats].

    Numbers at the end of what physics allows, effects that these motions cannot show, masses that
    leave a link, drives that deliver something else than they report.

    Args:
        problem: the logs.
        fit: of the causes.
    """
    return (
        sum(effect.implausibility for effect in fit.effects)
        + _ends(problem, fit)
        + _not_shown(problem, fit)
        + _lost_mass(problem, fit)
        + _wrong_drives(problem, fit)
    )


def _ends(problem: Problem, fit: Fit) -> float:
    """Return what numbers at the end of their range cost; shapes there do not.

    An effect at the end of its shapes often turns into a simpler one.
    """
    ends = {}
    for row, (k, parameter) in enumerate(fit.parameters):
        effect = fit.effects[k]
        value = effect.values[parameter.name]
        nulls = effect.null_values(problem.robot, effect.where)
        null = nulls.get(parameter.name, parameter.null)
        if not parameter.shape and value in (parameter.low, parameter.high):
            ends[row] = (1.0 if value == parameter.high else -1.0, value == null)
    if not ends:
        return 0.0
    steps = bootstrap_steps(fit, problem.blocks)
    cost = 0.0
    for row, (side, harmless) in ends.items():
        if np.percentile(side * steps[:, row], 1.0) > 0.0:
            cost += _BEYOND
        elif not harmless:
            cost += _AT_END
    return cost


def _not_shown(problem: Problem, fit: Fit) -> float:
    motions = [record.motion for record in problem.records]
    hidden = [not effect.recognisable(fit.robot, motions) for effect in fit.effects]
    springs = [not _plays(problem, *gear) for gear in yielding_gears(fit.robot).items()]
    return _NOT_SHOWN * (sum(hidden) + sum(springs))


def _plays(problem: Problem, joint: str, gear: Flanks) -> bool:
    """Whether a gear is no spring that is taken for play between soft flanks."""
    if gear.play == 0.0:
        return True
    row = problem.robot.velocity_index(joint)
    loads = [record.links[:, row] - record.contacts[:, row] for record in problem.records]
    return plays(gear, max(float(np.max(np.abs(load))) for load in loads))


def _lost_mass(problem: Problem, fit: Fit) -> float:
    before, after = (
        np.array([inertia.mass for inertia in robot.model.inertias])
        for robot in (problem.robot, fit.robot)
    )
    heavy = before > 0.0
    left = np.log(np.maximum(after[heavy], 1e-300) / before[heavy])
    return float(0.5 * np.sum((np.minimum(left, 0.0) / _LOST) ** 2))


def _wrong_drives(problem: Problem, fit: Fit) -> float:
    gains = drive_gains(fit.robot, problem.records)
    return float(0.5 * np.sum((np.log(np.maximum(gains, 1e-300)) / _GAIN) ** 2))
