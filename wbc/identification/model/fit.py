"""Refining the parameters of a set of effects: bounded Gauss-Newton on the full model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import DynamicsError
from wbc.identification.model.columns import Columns, change_along, derivatives
from wbc.identification.model.descent import IDLE, RIDGE, Descent, Linearised, bounded, ranges
from wbc.identification.model.residual import IMPOSSIBLE, Evaluation, Slots, evaluate
from wbc.identification.model.usual import Part, UsualRows, cost
from wbc.identification.model.yielding import loose, some_deflect
from wbc.identification.records.record import Record, rows_of_folds
from wbc.robot import Effect, Parameter, Robot


def scaled(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return an information matrix (p, p) with ones on its diagonal, and the sizes (p,) taken out.

    It can be solved where parameters repeat one another.
    """
    size = np.sqrt(np.maximum(np.diagonal(information), 1e-300))
    return information / np.outer(size, size) + RIDGE * np.eye(size.size), size


def beside_others(information: FloatArray, rows: Sequence[int]) -> FloatArray:
    """Return (k, k) the information about some parameters while all others are free to move.

    Args:
        information: (p, p) about all parameters, in squared standard deviations.
        rows: the k parameters.
    """
    chosen = np.array(rows, dtype=np.intp)
    others = np.setdiff1d(np.arange(len(information)), chosen)
    own = information[np.ix_(chosen, chosen)]
    if not others.size:
        return own
    beside, size = scaled(information[np.ix_(others, others)])
    across = information[np.ix_(others, chosen)] / size[:, None]
    return np.asarray(own - across.T @ np.linalg.solve(beside, across))


ITERATIONS = 20
_CONVERGED = 1e-4
_CONVERGED_ROUGH = 3e-3  # a bouncing link has no smooth error to follow further
_NEXT_TO_NOTHING = 0.1  # share of what matters, for which no step is tried
_TRUSTED = 0.25  # error of a promised gain up to which derivatives from nearby are kept
_STRAIGHT = 1e-2  # share of a step's change in which it may miss what its derivatives promised
# Shares of a promised gain: with less than the first a step is damped more, with more than the
# second less, each time by as much; see Nocedal and Wright, "Numerical optimization", 2006.
_BENT, _FOLLOWED, _FIRST, _MORE, _TRIES = 0.25, 0.75, 0.01, 5.0, 8
_CUT = 0.4
_KNOWS_NOTHING = 1e-2  # share of the information of all rows
_ROUGH = 4.0  # times a fold's error, that a step of all other rows leaves of a rough model


@dataclass(frozen=True, eq=False)
class Fit:
    """A robot with effects whose parameters minimise the whitened residual on some records.

    Attributes:
        robot: with the effects.
        effects: as fitted, in order.
        residual: (rows, outputs), whitened.
        jacobian: (rows, outputs, p) change of the whitened residual per unit of each parameter's
            scale; in memory one parameter stands after the other.
        parameters: the p fitted parameters as (number of effect, parameter).
        usual: rows of what is usual, which are fitted beside those of the records.
        settled: whether more steps would gain nothing.
        whole: whether no derivative was taken from another fit.
        folds: (rows,) number of the fold of every row; none where all rows are one.
        failed: why the robot cannot have these effects on these records, empty if it can; then all
            of the residual is infinite, so that the model loses every comparison.
    """

    robot: Robot
    effects: tuple[Effect, ...]
    residual: FloatArray
    jacobian: FloatArray
    parameters: tuple[tuple[int, Parameter], ...]
    usual: UsualRows
    settled: bool = True
    whole: bool = True
    folds: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int_))
    failed: str = ""

    @property
    def values(self) -> FloatArray:
        """Parameters (p,) in units of their scales."""
        return np.array([self.effects[k].values[p.name] / p.scale for k, p in self.parameters])

    @property
    def error(self) -> float:
        """Mean square of the whitened residual on the records of the fit."""
        return float(np.mean(self.residual**2))

    @property
    def swings(self) -> bool:
        """Whether links were simulated behind their gears."""
        return some_deflect(self.effects)

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The normal equations of each fold."""
        rows = rows_of_folds(self.folds) if self.folds.size else [slice(None)]
        return tuple(Part(own, *self.sums(own)) for own in rows)

    @cached_property
    def known(self) -> FloatArray:
        """(p, p) what the records and what is usual know of the parameters, in their scales.

        Beside numbers that are drawn to what is usual: in squared standard deviations.
        """
        usual = self.usual.jacobian
        return np.asarray(np.sum([part.gram for part in self.parts], axis=0) + usual.T @ usual)

    @cached_property
    def moment(self) -> FloatArray:
        """(p,) by which the Gauss-Newton step solves `known` step = -moment."""
        usual = self.usual.jacobian.T @ self.usual.residual
        return np.asarray(np.sum([part.moment for part in self.parts], axis=0) + usual)

    def untold(self) -> FloatArray:
        """Return (effects,) how many numbers of each effect what is usual tells, not the records.

        With C the covariance of the parameters and P what is usual knows of them, the records tell
        the share 1 - (C P)_kk of parameter k (MacKay, 1992). Zero where nothing is drawn.
        """
        if not self.usual.residual.size or self.failed:
            return np.zeros(len(self.effects))
        known, size = scaled(self.known)
        usual = self.usual.jacobian / size
        shares = np.clip(np.diagonal(np.linalg.solve(known, usual.T @ usual)), 0.0, 1.0)
        owners = [k for k, _ in self.parameters]
        return np.asarray(np.bincount(owners, shares, len(self.effects)), dtype=float)

    def held_out_residual(self) -> FloatArray:
        """Return the residual (rows, outputs), each fold predicted without itself.

        The parameters of each fold are one Gauss-Newton step away from those of all records. Where
        the model is too rough for such a step (a bouncing link), the fold's parameters stay.
        """
        held = self.residual.copy()
        if self.failed or not self.parameters:
            return held
        for rows, gram, moment in self.without_each():
            held[rows] += change_along(self.jacobian[rows], self._solved(gram, moment))
        return held

    def without_each(self) -> Iterator[Part]:
        """Yield the rows of each fold, with the normal equations of all other rows.

        Where the model is too rough for a step that they tell (a bouncing link), those of all rows.
        """
        gram = np.sum([part.gram for part in self.parts], axis=0)
        moment = np.sum([part.moment for part in self.parts], axis=0)
        for rows, own, along in self.parts:
            others = gram - own, moment - along
            here = self.residual[rows]
            if self.swings:
                moved = here + change_along(self.jacobian[rows], self._solved(*others))
                if np.sum(moved**2) >= _ROUGH * np.sum(here**2):
                    others = gram, -self.usual.jacobian.T @ self.usual.residual
            yield Part(rows, *others)

    def step(self, rows: BoolArray | IntArray | slice) -> FloatArray:
        """Return the Gauss-Newton step (p,) on a choice of rows.

        Directions about which those rows know next to nothing compared with all rows stay put;
        else a clipping limit that only one block reached would fly away on the others.
        """
        return self._solved(*self.sums(rows))

    def steps_of_blocks(self, blocks: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the Gauss-Newton step (p,), and deviations A (B, p): A' A is its covariance.

        To first order, with the blocks drawn anew: the variance of B such parts of a step.

        Args:
            blocks: (rows,) number of the block of every row.
        """
        known, size = scaled(self.known)
        solved = np.linalg.inv(known)
        step = -(solved @ (self.moment / size)) / size
        # Each block pulls by what it has left at the end of that step.
        left = (self.residual + change_along(self.jacobian, step)) / self.usual.noise
        pulls = np.einsum("rop,ro->rp", self.jacobian, left)
        _, index = np.unique(blocks, return_inverse=True)
        each = np.stack([np.bincount(index, column) for column in pulls.T], axis=1)
        moved = -(each / size) @ solved / size
        count = len(moved)
        return np.asarray(step), np.sqrt(count / max(count - 1, 1)) * (moved - moved.mean(axis=0))

    def sums(self, rows: BoolArray | IntArray | slice) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations (p, p) and (p,) of a choice of rows."""
        a = self.usual.weighted(self.jacobian[rows])
        return a.T @ a, a.T @ (self.residual[rows] * self.usual.weights).ravel()

    def _solved(self, gram: FloatArray, moment: FloatArray) -> FloatArray:
        """Return the step (p,) of normal equations, beside what is usual."""
        known, along, norm = self.beside_usual(gram, moment)
        return np.asarray(np.linalg.solve(known, -along) / norm)

    def beside_usual(
        self, gram: FloatArray, moment: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return normal equations beside what is usual, in units of the columns' sizes, and these.

        The size (p,) of a column that says nothing is infinite.
        """
        norm, usual, leaning = self._beside
        return gram / np.outer(norm, norm) + usual, moment / norm + leaning, norm

    @cached_property
    def _beside(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(p,) size of each column over all rows, and normal equations (p, p), (p,) of the usual.

        The size is infinite for a column that says nothing. So is that of a number at an end of its
        range, beyond which all rows together want it: what a robot cannot be predicts no fold.
        Efficiencies of 1.00 stood for a delay so.
        """
        norm = np.sqrt(np.sum([np.diagonal(part.gram) for part in self.parts], axis=0))
        room = ranges(self.effects, self.parameters)
        _, free = bounded(self.known, self.moment, room)
        free |= np.all(room != 0.0, axis=0)
        norm = np.where(free & (norm > IDLE * norm.max(initial=0.0)), norm, np.inf)
        leaning = self.usual.jacobian / norm
        known = leaning.T @ leaning + _KNOWS_NOTHING * np.eye(norm.size)
        return norm, known, leaning.T @ self.usual.residual


def refine(
    columns: Columns,
    effects: Sequence[Effect],
    whitening: FloatArray,
    iterations: int,
    samples: FloatArray,
    ask: Callable[[], None] = lambda: None,
    near: Fit | None = None,
) -> Fit:
    """Fit all parameters of `effects` added to a robot.

    Derivatives are kept from one step to the next, and taken from another fit, as long as the steps
    that they say do what they promise.

    Args:
        columns: of the robot that lacks them, on the logs.
        effects: start values.
        whitening: (outputs, judged outputs) by which residuals are multiplied.
        iterations: at most this many Gauss-Newton steps.
        samples: (outputs,) independent samples per row. Where numbers are drawn to what is usual,
            it says how much the logs weigh beside that.
        ask: called before what is left and its derivatives are worked out, each time; what it
            raises ends the fit.
        near: another fit on these records, of which derivatives are taken.

    Raises:
        EffectError: the robot has no place for one of the effects.
        TransmissionError: a gear cannot have these numbers.
    """
    robot, records = columns.robot, columns.records
    slots = tuple((k, p) for k, effect in enumerate(effects) for p in effect.parameters)
    swings = some_deflect(effects)

    def again(at: Evaluation) -> Evaluation:
        """Return the same once more where links bounce: how windows begin settles in steps."""
        return evaluate(robot, at.effects, records, whitening, at) if loose(at.effects) else at

    def slopes(at: Evaluation, known: Mapping[int, FloatArray]) -> FloatArray:
        ask()
        return derivatives(columns, at, slots, whitening, known)

    def tried(at: Evaluation, effects: Sequence[Effect]) -> tuple[Evaluation, float]:
        """Return what effects close by leave, and its cost."""
        ask()
        try:
            there = evaluate(robot, effects, records, whitening, at)
        except IMPOSSIBLE:
            return at, np.inf
        return there, cost(there.effects, there.residual, samples)

    ask()
    try:
        at = evaluate(robot, effects, records, whitening)
    except DynamicsError as error:
        return _failed(robot.with_effects(*effects), effects, slots, records, whitening, str(error))
    at = again(at)
    known = {} if near is None else _shared(near, effects, slots)
    taken = frozenset(known)  # parameters whose derivatives another fit says
    jacobian = slopes(at, known)
    ended, damping = not slots, 0.0
    for _ in range(iterations if slots else 0):
        usual = UsualRows.of(at.effects, slots, at.residual, samples)
        here = Linearised.of(at.effects, slots, at.residual, jacobian, usual)
        before = cost(at.effects, at.residual, samples)
        matters = before * (_CONVERGED_ROUGH if loose(effects) else _CONVERGED)
        found = _descend(here, at, before, tried, damping, matters)
        if found is None:
            if not known:
                ended = True
                break
            at, known, taken, damping = again(at), {}, frozenset(), 0.0
            jacobian = slopes(at, known)
            continue
        moved, step, gain, damping = found
        kept = gain / step.promised
        settled = gain < matters and kept > _BENT
        change = change_along(jacobian, step.along)
        bend = float(np.linalg.norm(moved.residual - at.residual - change))
        straight = bend < _STRAIGHT * float(np.linalg.norm(change))
        if (straight and not swings) or (settled and (taken or not swings)):
            # Nothing bends on this way: the derivatives hold at its end, too.
            at = moved
            if settled:
                ended = True
                break
            continue
        # Where nothing swings, what another fit says serves as long as steps leave less with it.
        trusted = abs(kept - 1.0) < _TRUSTED or (bool(taken) and not swings)
        fresh, at = not known, moved
        if trusted:
            held = {row for row, (k, _) in enumerate(slots) if columns.swings(at, at.effects[k])}
            known = {row: jacobian[:, :, row] for row in held | taken}
        else:
            at, known, taken = again(at), {}, frozenset()
        jacobian = slopes(at, known)
        if settled and (trusted or fresh):
            ended = True
            break
    whole = robot.with_effects(*at.effects)
    usual = UsualRows.of(at.effects, slots, at.residual, samples)
    return Fit(whole, at.effects, at.residual, jacobian, slots, usual, ended, not taken)


def _descend(
    here: Linearised,
    at: Evaluation,
    before: float,
    tried: Callable[[Evaluation, Sequence[Effect]], tuple[Evaluation, float]],
    damping: float,
    matters: float,
) -> tuple[Evaluation, Descent, float, float] | None:
    """Return the end of a step that makes the cost fall, the step, by how much, and the damping.

    None where none does, or none is promised what matters. A step that is too long is damped, which
    turns it down the steepest way. Where links swing that way says little, and it is cut: damped, a
    fit of a soft and a loose gear took 37 steps, and 15 cut.
    """
    cut = 1.0
    for _ in range(_TRIES):
        step = here.step(damping, matters, cut)
        if cut == 1.0 and 0.0 <= step.promised < _NEXT_TO_NOTHING * matters:
            break
        moved, after = tried(at, step.effects) if step.promised > 0.0 else (at, np.inf)
        gain = before - after
        if some_deflect(at.effects):
            cut *= _CUT
        elif gain < _BENT * step.promised:
            damping = max(damping * _MORE, _FIRST)
        elif gain > _FOLLOWED * step.promised:
            damping = damping / _MORE if damping > _FIRST else 0.0
        if gain > 0.0:
            return moved, step, gain, damping
    return None


def _shared(near: Fit, effects: Sequence[Effect], slots: Slots) -> dict[int, FloatArray]:
    """Return the derivatives of a fit by those parameters that it has, too."""
    own = {(near.effects[k].key, p.name): row for row, (k, p) in enumerate(near.parameters)}
    names = [(effects[k].key, parameter.name) for k, parameter in slots]
    return {row: near.jacobian[:, :, own[name]] for row, name in enumerate(names) if name in own}


def _failed(
    robot: Robot,
    effects: Sequence[Effect],
    slots: Slots,
    records: Sequence[Record],
    whitening: FloatArray,
    why: str,
) -> Fit:
    """Return the fit of what cannot move like these records."""
    shape = sum(record.rows for record in records), whitening.shape[1]
    residual, jacobian = np.full(shape, np.inf), np.zeros((*shape, len(slots)))
    usual = UsualRows(np.zeros(0), np.zeros((0, len(slots))), np.ones(whitening.shape[1]))
    return Fit(robot, tuple(effects), residual, jacobian, tuple(slots), usual, failed=why)
