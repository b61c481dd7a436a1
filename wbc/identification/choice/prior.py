"""How plausible a set of causes is before the logs speak."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import log_ndtr

from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.intervals import WIDER
from wbc.identification.model.residual import IMPOSSIBLE, drive_gains, drive_misses
from wbc.identification.model.yielding import deflects, plays, yielding_gears
from wbc.robot import Effect

_NAME, _PLACE, _NUMBER = 6.0, 3.0, 1.0  # [nats] for each name, place and number of a hypothesis
LEAST_ASKED = _PLACE + _NUMBER
"""What one cause more costs at least [nats]."""
_GAIN = 0.5  # standard deviation of the logarithm of delivered over reported torque
_FOLLOWED = 0.3  # share of the needed torque (rms) that such a drive may miss at most
_LOST = 0.5  # ... of the logarithms of the share of a link's mass that is left, and of what a robot
# weighs over twice its own mass, if more: machines seldom carry more than themselves
_NOT_SHOWN = 15.0  # [nats] for an effect that these motions cannot show for what it is


def asked(effects: Sequence[Effect], untold: float = 0.0) -> float:
    """Return what the names, places and numbers of a set of causes cost [nats].

    An effect that says several things at once counts as several names: a wrong drawing of a link,
    its mass, its centre and its inertia. Its numbers count as those of any other effect: where they
    cost nothing, the practice leg's payload is tied with a wrong drawing. A number costs nothing
    that the logs do not tell, since nothing was chosen with it.

    Args:
        effects: the causes.
        untold: how many of their numbers what is usual tells, not the logs.
    """
    names = {effect.name: effect.search.claims for effect in effects}
    numbers = sum(effect.search.freedom(effect) for effect in effects) - untold
    return _NAME * sum(names.values()) + _PLACE * len(effects) + _NUMBER * numbers


def implausible(problem: EstimationProblem, fit: Fit) -> tuple[float, ...]:
    """Return what each effect's numbers cost that no machine is likely to have [nats].

    Numbers at the end of what physics allows, effects that these motions cannot show, masses that
    leave a link or are more than it carries, drives that deliver something else than they report.

    Args:
        problem: the logs.
        fit: of the causes.
    """
    costs = _ends(problem, fit)
    motions = [record.motion for record in problem.records]
    for k, effect in enumerate(fit.effects):
        costs[k] += effect.search.implausibility(effect, fit.robot, motions)
        if not effect.search.recognisable(effect, fit.robot, motions) or not _plays(
            problem, fit, effect
        ):
            costs[k] += _NOT_SHOWN
        costs[k] += _wrong_mass(problem, effect) + _wrong_drive(problem, fit, effect)
    return tuple(costs)


def _ends(problem: EstimationProblem, fit: Fit) -> list[float]:
    """Return what numbers of each effect at the end of their range cost; shapes there do not.

    That is how improbable it is to find them by chance as far beyond as the logs want them:
    nothing where these do not tell. An effect at the end of its shapes often turns into a simpler
    one.
    """
    costs = [0.0] * len(fit.effects)
    ends = {}
    for row, (k, parameter) in enumerate(fit.parameters):
        value = fit.effects[k].values[parameter.name]
        if not parameter.shape and value in (parameter.low, parameter.high):
            ends[row] = 1.0 if value == parameter.high else -1.0
    if ends:
        step, deviations = fit.steps_of_blocks(problem.blocks)
        spread = np.maximum(WIDER * np.linalg.norm(deviations, axis=0), 1e-300)
        for row, side in ends.items():
            beyond = max(side * step[row] / spread[row], 0.0)
            costs[fit.parameters[row][0]] -= float(np.log(2.0) + log_ndtr(-beyond))
    return costs


def _plays(problem: EstimationProblem, fit: Fit, effect: Effect) -> bool:
    """Whether a gear is no spring that is taken for play between soft flanks."""
    gears = yielding_gears(fit.robot) if deflects(effect) else {}
    gear = gears.get(effect.where)
    if gear is None or gear.play == 0.0:
        return True
    row = problem.robot.velocity_index(effect.where)
    loads = [record.load[:, row] for record in problem.records]
    return plays(gear, max(float(np.max(np.abs(load))) for load in loads))


def _wrong_mass(problem: EstimationProblem, effect: Effect) -> float:
    """Return what masses cost that leave a link, or that a robot can hardly carry.

    A rotor inertia at the first joint of an arm was tied with 400 kg beside its axis.
    """
    if "change" not in effect.acts_by:
        return 0.0
    try:
        robot = effect.change(problem.robot)
    except IMPOSSIBLE:
        return 0.0
    if robot.model is problem.robot.model:
        return 0.0
    before, after = (
        np.array([inertia.mass for inertia in one.model.inertias]) for one in (problem.robot, robot)
    )
    heavy = before > 0.0
    left = np.log(np.maximum(after[heavy], 1e-300) / before[heavy])
    carried = np.log(np.maximum(after.sum() / (2.0 * before.sum()), 1.0))
    return float(0.5 * (np.sum(np.minimum(left, 0.0) ** 2) + carried**2) / _LOST**2)


def _wrong_drive(problem: EstimationProblem, fit: Fit, effect: Effect) -> float:
    """Return what a drive costs that delivers something else than it reports.

    It would explain any report that holds no torque, unless what it delivers is what the motion
    needs.
    """
    if "drive" not in effect.acts_by:
        return 0.0
    robot = problem.robot.with_acting((effect,))
    off = 0.5 * (np.log(np.maximum(drive_gains(robot, problem.records), 1e-300)) / _GAIN) ** 2
    if np.sum(off) < 1.0:
        return float(np.sum(off))
    missed = np.minimum(drive_misses(fit.robot, problem.records) / _FOLLOWED, 1.0)
    return float(np.sum(off * missed))
