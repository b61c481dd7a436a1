"""Refining the parameters of a set of effects: bounded Gauss-Newton on the full model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.effects.links import SPREAD
from wbc.errors import DynamicsError
from wbc.identification.model.columns import STEP, Columns, derivatives, drawn
from wbc.identification.model.residual import IMPOSSIBLE, Evaluation, Slots, evaluate, with_changes
from wbc.identification.model.yielding import loose, some_deflect
from wbc.identification.records.record import Record, rows_of_folds
from wbc.robot import Effect, Parameter, Robot

# Added to a diagonal of ones, so that parameters that repeat one another can be solved for.
RIDGE = 1e-9
ROUNDS = 8
"""Rounds until the factor by which a drawing is wrong repeats itself, to 2e-5 or better."""


class Part(NamedTuple):
    """Normal equations of some rows of a fit.

    Attributes:
        rows: their numbers.
        gram: (p, p), beside numbers that are drawn in squared standard deviations.
        moment: (p,) likewise.
    """

    rows: IntArray | slice
    gram: FloatArray
    moment: FloatArray


@dataclass(frozen=True, eq=False)
class UsualRows:
    """Departures of effects from what is usual, and their derivatives.

    Attributes:
        residual: (k,).
        jacobian: (k, p) per unit of each parameter's scale.
        noise: (outputs,) mean square of what is left over independent samples per row: squares of
            the logs are divided by it, so that both are in squared standard deviations.
        samples: (outputs,) independent samples per row.
        spread: what it costs that a drawing is more wrong than usual [2 nats].
    """

    residual: FloatArray
    jacobian: FloatArray
    noise: FloatArray
    samples: FloatArray
    spread: float = 0.0

    @classmethod
    def none(cls, outputs: int, count: int) -> UsualRows:
        """Return no rows about so many parameters."""
        return cls(np.zeros(0), np.zeros((0, count)), np.ones(outputs), np.ones(outputs))

    @classmethod
    def of(
        cls,
        effects: Sequence[Effect],
        slots: Sequence[tuple[int, Parameter]],
        noise: FloatArray,
        samples: FloatArray,
    ) -> UsualRows:
        """Return the rows of these effects.

        Numbers are held to a drawing with the standard deviation that is likeliest, see
        `more_wrong`. With the usual one a tool of 2.8 kg on a flange of 0.2 kg cost 12,700 nats.

        Args:
            effects: with their numbers.
            slots: the p parameters as (number of effect, parameter).
            noise: (outputs,) mean square of what is left over independent samples per row.
            samples: (outputs,) independent samples per row.
        """
        parts, wrong, spread = [], [], 0.0
        for effect in effects:
            held = effect.search.departures(effect)
            parts.append(np.concatenate([held, _beyond_usual(effect)]))
            size = 1.0
            if held.size:
                squares, count = np.array([np.sum(held**2)]), np.array([held.size])
                (size,) = more_wrong(squares, count).tolist()
                cost = np.log1p((np.log(size) / SPREAD) ** 2)
                spread += 2.0 * (held.size * np.log(size) + cost)
            wrong.append(np.where(np.arange(parts[-1].size) < held.size, size, 1.0))
        ends = np.cumsum([0, *(part.size for part in parts)])
        residual, sizes = (np.concatenate([np.zeros(0), *own]) for own in (parts, wrong))
        jacobian = np.zeros((residual.size, len(slots)))
        if residual.size:
            for column, (k, parameter) in enumerate(slots):
                if parts[k].size:
                    rows = slice(ends[k], ends[k + 1])
                    jacobian[rows, column] = slope_of(_departures, effects[k], parameter, parts[k])
        return cls(residual / sizes, jacobian / sizes[:, None], noise, samples, spread)

    @property
    def weights(self) -> FloatArray:
        """(outputs,) by which residuals are multiplied in a fit."""
        return np.asarray(1.0 / np.sqrt(self.noise))

    def weighted(self, jacobian: FloatArray) -> FloatArray:
        """Return derivatives (rows, outputs, p) with these weights, (rows * outputs, p)."""
        rows, outputs, count = jacobian.shape
        plain = jacobian.reshape(rows * outputs, count)
        if np.all(self.noise == 1.0):  # always, where nothing is drawn
            return plain
        return np.asarray((jacobian * self.weights[:, None]).reshape(plain.shape))

    def cost(self, residual: FloatArray) -> float:
        """Return what is minimised, with a residual (rows, outputs) of the logs [2 nats].

        Minus twice the log density, each output with a variance of its own, never below that of
        its sensors: an output that nothing explains does not outvote the others.
        """
        squares = np.mean(residual**2, axis=0)
        variance = np.maximum(squares, 1.0)
        each = np.log(variance) + squares / variance
        beside = self.residual @ self.residual + self.spread
        return float(len(residual) * self.samples @ each + beside)

    def beside_open(
        self, held: FloatArray, jacobian: FloatArray, parts: Sequence[Part]
    ) -> tuple[FloatArray, float]:
        """Return held-out squares (rows, outputs) beside what is open, and what that costs [nats].

        A fold that is left out may be the only one that tells some of the drawn numbers. What the
        others then predict is off by as much as the prior leaves open, which a prediction with one
        value for each number takes for a miss. So the drawn numbers are integrated over. Numbers
        without a prior keep their one value: they have to repeat themselves from fold to fold.

        With r the held-out residual of a fold, W its weights, J its derivatives by the drawn
        numbers and A what all folds and the prior know of them, the log density of r is

            -1/2 r' (W - W J A^-1 J' W) r  +  1/2 log det(A - J' W J)  -  1/2 log det A  + const

        (Woodbury). Where nothing is drawn, these are the held-out squares, and no cost.

        Args:
            held: (rows, outputs) residual of each row, predicted without its fold.
            jacobian: (rows, outputs, p) per unit of each parameter's scale.
            parts: of the fit, fold by fold.
        """
        drawn = np.any(self.jacobian, axis=0)
        if not drawn.any():
            return held**2, 0.0
        chosen, usual = np.ix_(drawn, drawn), self.jacobian[:, drawn]
        known = np.sum([part.gram[chosen] for part in parts], axis=0) + usual.T @ usual
        squares, cost = np.empty_like(held), 0.0
        for rows, gram, _ in parts:
            own, left = jacobian[rows], held[rows]
            moment = np.einsum("rop,ro->p", own, left / self.noise)
            step = np.zeros(drawn.size)
            step[drawn] = np.linalg.solve(known, moment[drawn])
            squares[rows] = left * (left - change_along(own, step))
            cost += 0.5 * (_log_det(known) - _log_det(known - gram[chosen]))
        return squares, cost


def more_wrong(squares: FloatArray, count: IntArray) -> FloatArray:
    """Return by which factors drawings are likeliest more wrong than usual, 1 or more.

    Of n numbers, d^2 from what is usual in sum, and a factor s whose logarithm has the density of
    Cauchy, -n log s - d^2 / (2 s^2) - log(1 + (log s / w)^2) is largest where
    s^2 = d^2 / (n + 2 log s / (w^2 + (log s)^2)).  A tool on a small flange is further from its
    drawing than any drawing is wrong: beside a normal density it would not be found.

    Args:
        squares: d^2, of each drawing.
        count: n.
    """
    size = np.ones_like(squares)
    for _ in range(ROUNDS):
        told = np.maximum(count + 2.0 * np.log(size) / (SPREAD**2 + np.log(size) ** 2), 1.0)
        size = np.maximum(np.sqrt(squares / told), 1.0)
    return np.asarray(size)


def _log_det(matrix: FloatArray) -> float:
    return float(np.linalg.slogdet(matrix)[1])


def _departures(effect: Effect) -> FloatArray:
    """Return how far an effect is from what is usual, and each of its numbers that has a range.

    Beside open drawings no log tells a torque constant: it scales with all masses.
    """
    return np.concatenate([effect.search.departures(effect), _beyond_usual(effect)])


def _beyond_usual(effect: Effect) -> FloatArray:
    """Return how far each of an effect's numbers is outside its usual range, if it has one."""
    values = effect.values
    ranges = [(p.name, p.usual) for p in effect.parameters if p.usual is not None]
    return np.array([usual.departure(values[name]) for name, usual in ranges])


def slope_of(
    told: Callable[[Effect], FloatArray], effect: Effect, parameter: Parameter, now: FloatArray
) -> FloatArray:
    """Return by how much the numbers (n,) that an effect tells, `now`, change per scale."""
    value = effect.values[parameter.name]
    step = STEP * parameter.scale * (-1.0 if value + parameter.scale > parameter.high else 1.0)
    after = told(effect.with_values({parameter.name: value + step}))
    return np.asarray((after - now) * (parameter.scale / step))


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


ITERATIONS = 12
_CONVERGED = 1e-4
_CONVERGED_ROUGH = 3e-3  # a bouncing link has no smooth error to follow further
_TRUSTED = 0.25  # error of a promised gain up to which derivatives from nearby are kept
_STRAIGHT = 1e-2  # share of a step's change in which it may miss what its derivatives promised
_IDLE = 1e-7  # of the longest column: a shorter one is rounding
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
        _, free = _bounded_step(self.effects, self.parameters, self.known, self.moment)
        norm = np.where(free & (norm > _IDLE * norm.max(initial=0.0)), norm, np.inf)
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

    ask()
    try:
        at = evaluate(robot, effects, records, whitening)
    except DynamicsError as error:
        return _failed(robot.with_effects(*effects), effects, slots, records, whitening, str(error))
    at = again(at)
    known = {} if near is None else _shared(near, effects, slots)
    taken = frozenset(known)  # parameters whose derivatives another fit says
    jacobian = slopes(at, known)
    least = _CONVERGED_ROUGH if loose(effects) else _CONVERGED
    ended = not slots
    for _ in range(iterations if slots else 0):
        usual = _usual(at, slots, samples)
        step, _ = _bounded_step(at.effects, slots, *_normal(jacobian, at.residual, usual))
        found = _line_search(robot, at, slots, step, whitening, usual, ask)
        if found is None:
            if not known:
                ended = True
                break
            at, known, taken = again(at), {}, frozenset()
            jacobian = slopes(at, known)
            continue
        moved, length = found
        before = _cost(at, usual)
        gain = (before - _cost(moved, usual)) / before
        settled = gain < least or length * float(np.max(np.abs(step))) < _CONVERGED
        change = change_along(jacobian, length * step)
        bend = float(np.linalg.norm(moved.residual - at.residual - change))
        straight = bend < _STRAIGHT * float(np.linalg.norm(change))
        if (straight and not swings) or (settled and (taken or not swings)):
            # Nothing bends on this way: the derivatives hold at its end, too.
            at = moved
            if settled:
                ended = True
                break
            continue
        promised = float(np.sum((at.residual + change) ** 2))
        trusted = abs((at.cost - moved.cost) / max(at.cost - promised, 1e-300) - 1.0) < _TRUSTED
        # Where nothing swings, what another fit says serves as long as steps leave less with it.
        trusted |= bool(taken) and not swings
        fresh, at = not known, moved
        if trusted:
            kept = {row for row, (k, _) in enumerate(slots) if columns.swings(at, at.effects[k])}
            known = {row: jacobian[:, :, row] for row in kept | taken}
        else:
            at, known, taken = again(at), {}, frozenset()
        jacobian = slopes(at, known)
        if settled and (trusted or fresh):
            ended = True
            break
    whole = robot.with_effects(*at.effects)
    usual = _usual(at, slots, samples)
    return Fit(whole, at.effects, at.residual, jacobian, slots, usual, ended, not taken)


def _shared(near: Fit, effects: Sequence[Effect], slots: Slots) -> dict[int, FloatArray]:
    """Return the derivatives of a fit by those parameters that it has, too."""
    own = {(near.effects[k].key, p.name): row for row, (k, p) in enumerate(near.parameters)}
    names = [(effects[k].key, parameter.name) for k, parameter in slots]
    return {row: near.jacobian[:, :, own[name]] for row, name in enumerate(names) if name in own}


def _usual(at: Evaluation, slots: Slots, samples: FloatArray) -> UsualRows:
    if not any(map(drawn, at.effects)):
        return UsualRows.none(at.residual.shape[1], len(slots))
    variance = np.maximum(np.mean(at.residual**2, axis=0), 1.0)
    return UsualRows.of(at.effects, slots, variance / samples, samples)


def _cost(at: Evaluation, beside: UsualRows) -> float:
    """Return what is minimised, by the weights of the rows beside which it is compared."""
    if not beside.residual.size:
        return at.cost
    return UsualRows.of(at.effects, (), beside.noise, beside.samples).cost(at.residual)


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
    usual = UsualRows.none(whitening.shape[1], len(slots))
    return Fit(robot, tuple(effects), residual, jacobian, tuple(slots), usual, failed=why)


def change_along(jacobian: FloatArray, step: FloatArray) -> FloatArray:
    """Return what a step (p,) changes (rows, outputs), by derivatives (rows, outputs, p)."""
    rows, outputs, count = jacobian.shape
    return np.asarray((jacobian.reshape(rows * outputs, count) @ step).reshape(rows, outputs))


def _normal(
    jacobian: FloatArray, residual: FloatArray, usual: UsualRows
) -> tuple[FloatArray, FloatArray]:
    """Return the normal equations (p, p) and (p,) of all rows, beside what is usual."""
    a, beside = usual.weighted(jacobian), usual.jacobian
    moment = a.T @ (residual * usual.weights).ravel() + beside.T @ usual.residual
    return a.T @ a + beside.T @ beside, moment


def _bounded_step(
    effects: Sequence[Effect], slots: Slots, known: FloatArray, moment: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return the step (p,) that solves `known` step = -moment, and which parameters are free (p,).

    Those at an end of their range that would leave it are held.
    """
    values = np.array([effects[k].values[p.name] for k, p in slots])
    low = np.array([p.low for _, p in slots])
    high = np.array([p.high for _, p in slots])
    free = np.ones(len(slots), dtype=bool)
    step = np.zeros(len(slots))
    for _ in range(len(slots) + 1):
        step = np.zeros(len(slots))
        if free.any():
            step[free] = _least_squares(known[np.ix_(free, free)], -moment[free])
        blocked = free & (((values <= low) & (step < 0.0)) | ((values >= high) & (step > 0.0)))
        if not blocked.any():
            break
        free &= ~blocked
    return step, free


def _line_search(
    robot: Robot,
    at: Evaluation,
    slots: Slots,
    step: FloatArray,
    whitening: FloatArray,
    usual: UsualRows,
    ask: Callable[[], None],
) -> tuple[Evaluation, float] | None:
    """Return the first point along a step that leaves less, and which share of the step it is."""
    length, before = 1.0, _cost(at, usual)
    for _ in range(5):
        changes = {
            (k, p.name): length * float(s) * p.scale for (k, p), s in zip(slots, step, strict=True)
        }
        ask()
        try:
            moved = with_changes(at.effects, changes, clip=True)
            after = evaluate(robot, moved, at.records, whitening, at)
        except IMPOSSIBLE:
            length *= 0.4
            continue
        if _cost(after, usual) < before:
            return after, length
        length *= 0.4
    return None


def _least_squares(gram: FloatArray, moment: FloatArray) -> FloatArray:
    """Return the solution (p,) of normal equations, weak directions and idle columns left alone."""
    norm = np.sqrt(np.diagonal(gram))
    size = np.where(norm > _IDLE * norm.max(initial=0.0), norm, np.inf)
    known = gram / np.outer(size, size) + RIDGE * np.eye(size.size)
    return np.asarray(np.linalg.solve(known, moment / size) / size)
