"""What speaks against the causes found: absent causes that are tied to them, logs that disagree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.identification.answer.shown import with_unit
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.evaluation import IMPOSSIBLE, evaluate
from wbc.identification.model.fit import Fit, change_along
from wbc.identification.model.intervals import TAIL, WIDER
from wbc.identification.records.folds import ROWS_PER_SAMPLE
from wbc.identification.records.noise import synthetic_noise
from wbc.identification.records.record import Record
from wbc.robot import Effect
from wbc.robot.coordinates import unit_at

_STEP = 1e-2  # of a parameter's scale, by which an absent cause is tried
# Factor by which the variance of a number grows where a cause is added, from which on the two are
# said to be tied: then more of what is known of the number comes from the cause's absence than from
# the logs.
_TIED = 2.0
_MOST = 4.0  # scales of an absent cause that are called open at most
_MATTERS = 0.1  # share of a number that what is open of the cause must change
_STRAY = 8.0  # standard deviations between the logs' own values
_STRAY_SHARE = 0.05  # of the value itself, less is no disagreement worth a word
_ROUNDING = 1e-7  # of the largest column: rounding


@dataclass(frozen=True)
class _Tie:
    """A number found that rests on the absence of a cause.

    Attributes:
        row: number of the parameter.
        amount: of the absent cause that the logs leave open, in its unit.
        value: that the parameter would then have.
    """

    row: int
    amount: float
    value: float


def absent_ties(
    problem: EstimationProblem, fit: Fit, classes: Sequence[type[Effect]]
) -> list[list[str]]:
    """Return for every effect a sentence per absent cause at its place that is tied to a number.

    Causes of one number in the drive are tried: they act on the torque that everything else is
    judged by, such as its delay.

    Args:
        problem: the logs.
        fit: of the hypothesis chosen.
        classes: the candidates.
    """
    found: list[list[str]] = [[] for _ in fit.effects]
    if not fit.parameters or fit.failed or fit.swings:
        return found
    try:
        known = _Known(problem, fit)
    except IMPOSSIBLE:  # with more noise
        return found
    present = {effect.key for effect in fit.effects}
    places = dict.fromkeys(effect.where for effect in fit.effects)
    for kind in classes:
        if "drive" not in kind.acts_by or len(kind.parameters) != 1 or kind.parameters[0].shape:
            continue
        for where in places:
            if (kind.name, where) in present or where not in kind.places(problem.robot):
                continue
            for tie in known.beside(kind, where):
                owner, parameter = fit.parameters[tie.row]
                if fit.effects[owner].where != where:
                    continue
                amount = with_unit(tie.amount, kind.parameters[0].unit, 2)
                value = with_unit(tie.value, unit_at(problem.robot, where, parameter.unit), 2)
                found[owner].append(
                    f"{parameter.name} rests on the absence of {kind.name}: these logs leave "
                    f"{kind.parameters[0].name} {amount} open, and beside that it would be {value}"
                )
    return found


class _Known:
    """What a fit knows of its parameters, and would know beside one cause more."""

    def __init__(self, problem: EstimationProblem, fit: Fit) -> None:
        self.problem, self.fit = problem, fit
        self.weights = 1.0 / np.sqrt(problem.row_noise(fit.residual))
        self.columns = (fit.jacobian * self.weights[:, None]).reshape(-1, len(fit.parameters))
        usual = fit.usual.jacobian
        self.inverse = np.linalg.pinv(self.columns.T @ self.columns + usual.T @ usual, rcond=1e-12)
        self.noisy = [_with_more_noise(record) for record in problem.records]
        self.left, self.noisy_left = self._left((), problem.records), self._left((), self.noisy)

    def beside(self, kind: type[Effect], where: str) -> list[_Tie]:
        """Return the parameters that are tied to an absent cause."""
        parameter = kind.parameters[0]
        way = 1.0 if parameter.null + parameter.scale <= parameter.high else -1.0
        changed = parameter.null + way * _STEP * parameter.scale
        effect = kind(where, **{parameter.name: changed})
        fit, problem = self.fit, self.problem
        try:
            column = (self._left((effect,), problem.records) - self.left) / _STEP
            by_noise = (self._left((effect,), self.noisy) - self.noisy_left) / _STEP - column
        except IMPOSSIBLE:
            return []
        along = self.inverse @ (self.columns.T @ column)
        # What the noise of the report changes is no sign of the cause.
        told = column @ column - (self.columns.T @ column) @ along - by_noise @ by_noise
        least = (WIDER * TAIL / _MOST) ** 2
        still_open = WIDER * TAIL / np.sqrt(max(float(told), least))  # in scales, as intervals are
        own_variance = np.maximum(np.diagonal(self.inverse), 1e-300)
        grown = 1.0 + along**2 / max(float(told), least) / own_variance
        tied = []
        for row in np.flatnonzero(grown > _TIED):
            owner, own = fit.parameters[row]
            value = fit.effects[owner].values[own.name]
            change = -float(along[row]) * still_open * own.scale
            if not own.shape and abs(change) > _MATTERS * abs(value):
                amount = parameter.null + way * still_open * parameter.scale
                beside = float(np.clip(value + change, own.low, own.high))
                tied.append(_Tie(int(row), amount, beside))
        return tied

    def _left(self, more: tuple[Effect, ...], records: Sequence[Record]) -> FloatArray:
        """Return (rows * outputs,) what is left, weighted, beside some causes more."""
        effects = (*self.fit.effects, *more)
        at = evaluate(self.problem.robot, effects, records, self.problem.whitening)
        return np.asarray((at.residual * self.weights).ravel())


def _with_more_noise(record: Record) -> Record:
    """Return a record with the noise of its reported torques a second time.

    What a drive makes of its own measurement carries that noise, a target has none.
    """
    drawn, _ = synthetic_noise(record)
    gears = record.robot.transmission
    noise = drawn[:, : gears.size] / np.abs(gears.gear_ratio)
    motion, feedback = record.motion, record.motion.feedback_torque
    if feedback is not None:
        motion = motion.replace(feedback_torque=feedback + noise)
    return replace(record, torque=record.torque + noise, motion=motion)


def disagreements(records: Sequence[Record], fit: Fit) -> list[list[str]]:
    """Return for every effect a sentence per parameter on whose value the logs disagree.

    Logs of different robots, loads or units show so: each has a value of its own, one Gauss-Newton
    step away from the common one, and is explained by it far better than by the common one.

    Args:
        records: the logs.
        fit: to all of them.
    """
    found: list[list[str]] = [[] for _ in fit.effects]
    if len(records) < 2 or not fit.parameters:
        return found
    owner = np.repeat(np.arange(len(records)), [record.rows for record in records])
    alone = [_alone(fit, owner == k) for k in range(len(records))]
    steps, deviations = (np.array(part) for part in zip(*alone, strict=True))
    for row, (k, parameter) in enumerate(fit.parameters):
        value = fit.effects[k].values[parameter.name]
        own = value + steps[:, row] * parameter.scale
        doubt = _STRAY * float(deviations[:, row].max()) * parameter.scale
        if parameter.shape or np.ptp(own) < max(doubt, _STRAY_SHARE * abs(value)):
            continue
        low, high = int(np.argmin(own)), int(np.argmax(own))
        text = (
            f"the logs disagree on {parameter.name}: {records[low].name} alone says "
            f"{own[low]:.3g}, {records[high].name} {own[high]:.3g}"
        )
        unit = unit_at(fit.robot, fit.effects[k].where, parameter.unit)
        found[k].append(text if unit == "1" else f"{text} {unit}")
    return found


def _alone(fit: Fit, rows: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the step (p,) to what some rows alone say, and its standard deviation (p,)."""
    step = fit.step(rows)
    left = fit.residual[rows] + change_along(fit.jacobian[rows], step)
    a = fit.jacobian[rows].reshape(-1, len(fit.parameters))
    size = np.sqrt(np.sum(a**2, axis=0))
    seen = size > _ROUNDING * size.max()
    norm = np.where(seen, size, 1.0)
    gram = (a / norm).T @ (a / norm) + 1e-9 * np.eye(norm.size)
    spread = np.sqrt(ROWS_PER_SAMPLE * np.mean(left**2) * np.diag(np.linalg.inv(gram)))
    return step, np.where(seen, spread / norm, np.inf)
