"""Hypotheses: sets of causes, fitted, and the one number in nats by which they are compared.

It is how plausible the causes are before the logs speak, and how well they predict the logs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import log_ndtr

from wbc.arrays import FloatArray, IntArray
from wbc.identification.model.estimation_problem import ALIKE, DISTORTED, WIDER, EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import IMPOSSIBLE, drive_gains, drive_misses
from wbc.identification.model.yielding import deflects, loose, plays, some_deflect
from wbc.robot import Effect

Key = tuple[str, str]
"""Name and place of a cause."""

Offer = tuple[Effect, ...]
"""Effects with start values, not yet fitted."""

_NAME, _PLACE, _NUMBER = 6.0, 3.0, 1.0  # [nats] for each name, place and number of a hypothesis
LEAST_ASKED = _PLACE + _NUMBER
"""What one cause more costs at least [nats]."""
_GAIN = 0.5  # standard deviation of the logarithm of delivered over reported torque
_FOLLOWED = 0.3  # share of the needed torque (rms) that such a drive may miss at most
_LOST = 0.5  # ... of the logarithms of the share of a link's mass that is left, and of what a robot
# weighs over twice its own mass, if more: machines seldom carry more than themselves
_NOT_SHOWN = 15.0  # [nats] for an effect that these motions cannot show for what it is
_UNLIKELY = 6.9  # [nats], one in a thousand
_SIMULATED = 0.02  # share of the first error (rms) that simulated links distort
# ... and that links which bounce distort: they soon forget how they began. On the practice leg,
# fits of the play alone that began near it left 3.8 to 4.8 %, each in a valley of its own.
_BOUNCING = 0.05


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of causes, fitted; light enough that every one that was tried can be kept.

    Attributes:
        effects: the causes with fitted parameters, in the order in which they act.
        folds: (F, outputs) held-out mean squares of each fold, in floors.
        beside: (F, outputs) the same beside what is open of numbers that are drawn to a prior.
        open: what these numbers cost, being open while a fold is left out [nats].
        blocks: (B,) held-out mean squares of each block, all outputs together.
        samples: (outputs,) independent samples per row of what this hypothesis leaves.
        rows: (F,) rows of each fold.
        asked: what its names, places and numbers cost [nats].
        implausible: what each effect's numbers cost that no machine is likely to have [nats].
        untold: how many numbers of each effect what is usual tells, not the logs.
        contacts: by how much it is more probable that contacts hold, whose forces no sensor
            measured [nats].
        squares: (B, outputs) mean squares of each block in the outputs' units. Held out, or of the
            fit itself where they are larger: where it did not reach its end, it leaves more than a
            step further would leave held out.
        reported: (B, outputs) the same with what reports hold beyond the limits of drives.
        unheard: (outputs,) what these cost per independent sample [nats].
        whole: whether it is fitted to its end, with derivatives of its own.
    """

    effects: tuple[Effect, ...]
    folds: FloatArray
    beside: FloatArray
    open: float
    blocks: FloatArray
    samples: FloatArray
    rows: FloatArray
    asked: float
    implausible: tuple[float, ...]
    untold: tuple[float, ...] = ()
    contacts: float = 0.0
    squares: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    reported: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    unheard: FloatArray | float = 0.0
    whole: bool = True

    @property
    def prior(self) -> float:
        """Log prior [nats]."""
        return -self.asked - sum(self.implausible)

    @property
    def believable(self) -> bool:
        """Whether no cause is less likely than one in a thousand before the logs speak.

        Where much is left that no hypothesis explains, logs speak for any number that takes up a
        part of it, however impossible, and such causes hide others.
        """
        return len(self.likely) == len(self.effects)

    @property
    def likely(self) -> Offer:
        """The causes that are not less likely than one in a thousand before the logs speak."""
        pairs = zip(self.effects, self.implausible, strict=True)
        return tuple(effect for effect, cost in pairs if cost < _UNLIKELY)

    @property
    def outputs(self) -> FloatArray:
        """(outputs,) held-out mean squares, in floors."""
        return np.asarray(self.rows @ self.folds / self.rows.sum())

    @property
    def error(self) -> float:
        """Held-out mean square in floors, all outputs together."""
        return float(self.outputs.mean())

    @property
    def keys(self) -> tuple[Key, ...]:
        """Names and places of the causes."""
        return tuple(effect.key for effect in self.effects)

    def begun(self, effects: Sequence[Effect]) -> Offer:
        """Return effects with the numbers that this hypothesis has for them."""
        own = {effect.key: effect for effect in self.effects}
        return tuple(own.get(effect.key, effect) for effect in effects)

    def only_noise(self, problem: EstimationProblem) -> bool:
        """Whether no output is left with more than what no two models are told apart by."""
        return bool(np.all(self.squares.mean(axis=0) <= problem.indistinct))

    @property
    def swings(self) -> bool:
        """Whether links were simulated behind their gears."""
        return some_deflect(self.effects)

    @property
    def bounces(self) -> bool:
        """Whether one of these links has play."""
        return loose(self.effects)

    @property
    def distorts(self) -> float:
        """Share of the first error (rms) by which filters, or simulations, are off."""
        share = _SIMULATED if self.swings else DISTORTED
        return _BOUNCING if self.bounces else share


def fold_means(folds: IntArray, squares: FloatArray) -> FloatArray:
    """Return (F, outputs) the mean of squares (rows, outputs) over each fold."""
    _, index = np.unique(folds, return_inverse=True)
    sums = np.stack([np.bincount(index, column) for column in squares.T], axis=1)
    return np.asarray(sums / np.bincount(index)[:, None])


def without(effects: Sequence[Effect], *dropped: Effect) -> tuple[Effect, ...]:
    """Return the effects but those given."""
    keys = {effect.key for effect in dropped}
    return tuple(effect for effect in effects if effect.key not in keys)


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
    gear = fit.robot.transmission.flanks(effect.where) if deflects(effect) else None
    if gear is None or gear.play == 0.0:
        return True
    row = problem.robot.velocity_index(effect.where)
    load = max(float(np.abs(record.load[:, row]).max()) for record in problem.records)
    return plays(gear, load)


def _wrong_mass(problem: EstimationProblem, effect: Effect) -> float:
    """Return what masses cost that leave a link, or that a robot can hardly carry.

    A rotor inertia at the first joint of an arm was tied with 400 kg beside its axis.
    """
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


def weigh(problem: EstimationProblem, hypotheses: Sequence[Hypothesis]) -> FloatArray:
    """Return the log evidence of each hypothesis [nats], up to a constant that they share.

    The log density of what is left on held-out data, plus the log prior:

        sum over folds f and outputs o of  n_fo (-1/2 log v_o - 1/2 s_fo / v_o)  +  log prior

    with s_fo the held-out mean square in floors, and v_o the variance that all folds show together,
    never below that of the sensors (1), plus what filters and simulations distort: what leaves less
    in every fold has more density. n_fo counts the independent samples of the fold. What is left is
    autocorrelated; at each output the hypothesis that leaves least there says how much, for all of
    them, or else the differences would mean nothing. What filters distort is the same in all folds:
    with N samples altogether,
    n_fo is divided by 1 + N (a d first)^2 / v, a being the share that may look like one cause.
    Of reports beyond a limit it predicts only that they are beyond: where these exceed it by m in
    the mean, each has the log density -1 - log m in the place of -log(2 pi e s^2) / 2, that of what
    is left (rms s).
    Where no sensor measured the forces of contacts, what makes these contacts move is less
    probable, too (`HeldContacts.evidence`).

    Args:
        problem: the logs.
        hypotheses: at least one.
    """
    beside = np.array([h.prior - h.open + h.contacts for h in hypotheses])
    return np.asarray(log_densities(problem, hypotheses).sum(axis=1) + beside)


def left_to_gain(problem: EstimationProblem, h: Hypothesis) -> float:
    """Return what one cause more can add to the log density of a hypothesis at most [nats].

    Where links are simulated, what leaves nothing at all has no more density than what leaves as
    much as the simulation distorts.
    """
    if not h.swings:
        return np.inf
    nothing = np.zeros_like(h.beside)
    best = replace(h, folds=nothing, beside=nothing, samples=problem.white_samples)
    here, there = log_densities(problem, [h, best]).sum(axis=1)
    return float(there - here)


def log_densities(problem: EstimationProblem, hypotheses: Sequence[Hypothesis]) -> FloatArray:
    """Return (n, outputs) the log density of what each hypothesis leaves, without the prior.

    Args:
        problem: the logs.
        hypotheses: at least one.
    """
    reference = min(hypotheses, key=lambda h: h.error)
    least = np.argmin([h.outputs for h in hypotheses], axis=0)
    whiteness = np.array([h.samples for h in hypotheses])[least, np.arange(least.size)]
    samples = reference.rows[:, None] * whiteness
    distorted = problem.distorted(reference.distorts)
    if not reference.swings:
        least_left = np.maximum(np.min([h.outputs for h in hypotheses], axis=0), 1.0) + distorted
        samples /= 1.0 + samples.sum(axis=0) * ALIKE**2 * distorted / least_left
    densities = []
    for h in hypotheses:
        if reference.swings:
            # A simulated link is off by as much in a way of its own: nothing below is evidence.
            left = np.maximum(h.beside, 1.0 + distorted)
            variance = h.rows @ left / h.rows.sum()
        else:
            left = h.beside
            variance = np.maximum(h.rows @ left / h.rows.sum(), 1.0) + distorted
        density = -0.5 * np.sum(samples * (np.log(variance) + left / variance), axis=0)
        densities.append(density - samples.sum(axis=0) * h.unheard)
    return np.array(densities)


def density_gained(
    problem: EstimationProblem,
    h: Hypothesis,
    before: FloatArray,
    after: FloatArray,
    samples: FloatArray,
) -> FloatArray:
    """Return (K,) by how much the log density of a hypothesis rises where it left other squares.

    As `log_densities`, nothing held out.

    Args:
        problem: the logs.
        h: the hypothesis.
        before: (outputs,) mean squares that it leaves, in floors.
        after: (K, outputs) others.
        samples: (outputs,) independent samples per row of what these leave.
    """
    distorted, rows = problem.distorted(h.distorts), h.rows.sum()
    count = rows * np.where(after < before, samples, h.samples)
    if h.swings:
        least = 1.0 + distorted
        one, other = (np.maximum(s, least) for s in (before, after))
        return np.asarray(-0.5 * np.sum(count * np.log(other / one), axis=1))
    left = np.maximum(np.minimum(before, after), 1.0) + distorted
    count = count / (1.0 + count * ALIKE**2 * distorted / left)
    one, other = (np.maximum(s, 1.0) + distorted for s in (before, after))
    change = np.log(other / one) + after / other - before / one
    return np.asarray(-0.5 * np.sum(count * change, axis=1))
