"""What causes add to the evidence, beside a fit or in the place of its own: by its derivatives.

With J the derivatives of a fit, r what it leaves, W the weights of its outputs, C the columns of
new causes, the step that makes

    (r + J n + C z)' W (r + J n + C z)  +  what is usual of n and z

least says to first order what is left. Causes that give way are parameters n whose step is known.
One solution of the system of the fit, and one small system for each new cause (Schur complement),
tell it of all causes at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, combinations, product
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from wbc.arrays import FloatArray, IntArray
from wbc.effects.pseudo_inertia import ROUNDS, more_wrong
from wbc.identification.choice.candidate_columns import Regressor, evidence, make_regressors
from wbc.identification.choice.drop_screen import Normal, cheaper, sums_by_output, until_null
from wbc.identification.choice.evidence import Hypothesis, Key, density_gained
from wbc.identification.model.descent import RIDGE
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import evaluate
from wbc.robot import Effect, Evidence

_AT_ONCE = 16  # causes whose columns are multiplied at once
_BUILT = 40  # causes whose numbers are looked at, those that add most density first
_WHOLE = "robot"  # where effects sit that have no place


Numbers = tuple[int, ...]
"""Of causes, among those of a screen."""


class Proposed(NamedTuple):
    """Causes that a hypothesis may lack.

    Attributes:
        density: by how much derivatives say that the log density rises [nats].
        prior: by how much the log prior does, without what implausible numbers cost [nats].
        added: the causes with the numbers that derivatives give them.
        shaped: whether one of them has numbers that no derivative tells.
    """

    density: float
    prior: float
    added: tuple[Effect, ...]
    shaped: bool

    @property
    def gain(self) -> float:
        """By how much the evidence rises [nats]."""
        return self.density + self.prior


class _Products(NamedTuple):
    """Products of r columns at every output; with a leading axis of choices of them."""

    beside: FloatArray
    """(outputs, p, r) with the derivatives of the fit."""
    among: FloatArray
    """(outputs, r, r) with one another."""
    along: FloatArray
    """(outputs, r) with what is left."""
    usual: FloatArray
    """(r, r) normal equations of what is usual."""

    def some(self, columns: IntArray) -> _Products:
        """Return the products of choices (K, s) of the columns."""
        rows, others = columns[:, :, None], columns[:, None]
        return _Products(
            self.beside[:, :, columns].transpose(2, 0, 1, 3),
            self.among[:, rows, others].swapaxes(0, 1),
            self.along[:, columns].swapaxes(0, 1),
            self.usual[rows, others],
        )


@dataclass(frozen=True, eq=False)
class CauseScreen:
    """Columns of causes beside a fit.

    Attributes:
        problem: the logs.
        h: a hypothesis.
        fit: of it.
        regressors: the causes, once for each of their shapes.
    """

    problem: EstimationProblem
    h: Hypothesis
    fit: Fit
    regressors: tuple[Regressor, ...]

    @classmethod
    def of(
        cls,
        problem: EstimationProblem,
        h: Hypothesis,
        fit: Fit,
        offered: Sequence[type[Effect]],
        failures: Counter[str],
    ) -> CauseScreen:
        """Return the screen of all causes that could be added, or stand in the place of one.

        Shapes that follow the data are those that show with all causes, and at the place of each
        cause those that show without it.

        Args:
            problem: the logs.
            h: the hypothesis.
            fit: of it.
            offered: effect classes that act at once.
            failures: errors inside effects are counted there.
        """
        at = evaluate(problem.robot, fit.effects, problem.records, problem.whitening)
        shown: list[tuple[Evidence, list[str] | None]]
        shown = [(evidence(fit.robot, problem.records), None)]
        for gone in () if fit.swings else fit.effects:  # links that swing would be simulated
            rest = problem.robot.with_effects(*(e for e in fit.effects if e is not gone))
            shown.append((evidence(rest, problem.records), [gone.where]))
        made = make_regressors(problem.columns, at, offered, shown, failures, problem.still)
        felt = (own for own in made if problem.whitening[own.columns.outputs].any())
        # A drawing is wrong once: as a whole, or in one of its links.
        places = {effect.where for effect in fit.effects if effect.search.drawn}
        known = [r for r in felt if not (r.drawn and places and _WHOLE in {*places, r.where})]
        return cls(problem, h, fit, tuple(known))

    def beside(self, h: Hypothesis, fit: Fit) -> CauseScreen:
        """Return the screen of the same columns beside another fit."""
        return CauseScreen(self.problem, h, fit, self.regressors)

    def ranked(self, own: Sequence[Effect], taken: Sequence[Key], count: int) -> list[Proposed]:
        """Return the causes that add most to the evidence, one shape of each, the best first.

        Args:
            own: causes of the hypothesis that give way.
            taken: names and places that are not proposed.
            count: how many at most.
        """
        found: dict[Key, Proposed] = {}
        for k, density, numbers in self._best_first(own, taken):
            key = self.regressors[k].key
            if key not in found and (made := self._proposed((k,), density, numbers, own)):
                found[key] = made
            if len(found) == _BUILT:
                break
        return sorted(found.values(), key=lambda one: -one.gain)[:count]

    def drawings(self, taken: Sequence[Key]) -> list[Proposed]:
        """Return the best of every effect that is drawn to what is usual.

        Derivatives say little of it, and many others imitate a part each.
        """
        found: dict[type[Effect], Proposed] = {}
        for k, density, numbers in self._best_first((), taken):
            own = self.regressors[k]
            if own.drawn and own.effect not in found:
                made = self._proposed((k,), density, numbers, ())
                found |= {} if made is None else {own.effect: made}
        return list(found.values())

    def together(self, sets: Sequence[Numbers], count: int) -> list[Proposed]:
        """Return what sets of causes add together where a robot can have them.

        Args:
            sets: of causes that are looked at together.
            count: how many are returned at most, those that add most density.
        """
        best: dict[frozenset[Key], Proposed] = {}
        for gain, several, numbers in self._ordered(self._by_size(sets), ()):
            keys = frozenset(self.regressors[k].key for k in several)
            if keys not in best and (made := self._proposed(several, gain, numbers, ())):
                best[keys] = made
            if len(best) == count:
                break
        return list(best.values())

    def in_all_gears(self, taken: Sequence[Key]) -> list[Numbers]:
        """Return every effect in its best shape at all joints at which it can be.

        One cause in all gears is a simpler story than two different ones.
        """
        groups: dict[str, dict[str, int]] = {}
        for k, _, numbers in self._best_first((), taken):
            own = self.regressors[k]
            best = groups.setdefault(own.effect.name, {})
            if own.where in self.problem.robot.transmission.joints and own.where not in best:
                best |= {} if own.build(self.fit.robot, numbers) is None else {own.where: k}
        return [(*best.values(),) for best in groups.values() if len(best) > 1]

    def pairs(self, taken: Sequence[Key]) -> Iterator[list[Numbers]]:
        """Yield all pairs of causes at every joint: there, in the link that it moves, or anywhere.

        No pair has the whole drawing, which is tried beside all causes.
        """
        robot = self.problem.robot
        moved = {body: robot.model.names[robot.body_joint(body)] for body in robot.bodies}
        groups: dict[str, list[int]] = {}
        for k, own in enumerate(self.regressors):
            if own.key not in taken and not (own.drawn and own.where == _WHOLE):
                groups.setdefault(moved.get(own.where, own.where), []).append(k)
        anywhere = groups.get(_WHOLE, [])
        for where, group in groups.items():
            pairs = [*combinations(group, 2)]
            if where != _WHOLE:
                pairs += [(min(p), max(p)) for p in product(group, anywhere)]
            yield [p for p in pairs if len({self.regressors[k].key for k in p}) == len(p)]

    def _best_first(
        self, own: Sequence[Effect], taken: Sequence[Key]
    ) -> Iterator[tuple[int, float, FloatArray]]:
        """Yield number, density and numbers of each cause, that which adds most density first."""
        for density, (k,), numbers in self._ordered(self._alone, own) if own else self._beside_all:
            if self.regressors[k].key not in taken:
                yield k, density, numbers

    @cached_property
    def _beside_all(self) -> list[tuple[float, Numbers, FloatArray]]:
        """Density and numbers of each cause where none gives way: one move asks three times."""
        return self._ordered(self._alone, ())

    def _ordered(
        self, each: Iterable[tuple[list[Numbers], _Products]], own: Sequence[Effect]
    ) -> list[tuple[float, Numbers, FloatArray]]:
        """Return density, causes and their numbers of each set, what adds most density first."""
        found: list[tuple[float, Numbers, FloatArray]] = []
        for alike, products in each:
            density, numbers = self._density(products, own)
            found += zip(density.tolist(), alike, numbers, strict=True)
        return sorted(found, key=lambda one: -one[0])

    def _proposed(
        self, several: Numbers, density: float, numbers: FloatArray, own: Sequence[Effect]
    ) -> Proposed | None:
        """Return causes with their numbers; None where a robot cannot have them.

        Friction may not push: of several that are possible alone, those two or more count that are
        possible beside the others.
        """
        made = [self.regressors[k] for k in several]
        parts = np.split(numbers, np.cumsum([one.size for one in made])[:-1])
        pairs = zip(made, parts, strict=True)
        added = [one.build(self.fit.robot, part) for one, part in pairs]
        new = tuple(effect for effect in added if effect is not None)
        if len(new) < min(len(made), 2):
            return None
        shaped = any(p.shape for effect in new for p in effect.parameters)
        return Proposed(density, cheaper(self.h, own, new), new, shaped)

    @cached_property
    def _derivatives(self) -> FloatArray:
        """(outputs, p, rows) of the fit."""
        return np.ascontiguousarray(self.fit.jacobian.transpose(1, 2, 0))

    @cached_property
    def _normal(self) -> Normal:
        return Normal.of(self.fit.known, self.fit.moment)

    @cached_property
    def _sums(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Products of derivatives and residual, see `sums_by_output`."""
        return sums_by_output(self._derivatives, self.fit.residual.T)

    @cached_property
    def _alone(self) -> list[tuple[list[Numbers], _Products]]:
        """All causes by themselves, those with as many columns together."""
        each: dict[int, list[tuple[list[Numbers], _Products]]] = {}
        for first in range(0, len(self.regressors), _AT_ONCE):
            some = range(len(self.regressors))[first : first + _AT_ONCE]
            for alike, products in self._by_size([(k,) for k in some]):
                each.setdefault(products.along.shape[2], []).append((alike, products))
        whole = (zip(*parts, strict=True) for parts in each.values())
        return [
            ([*chain(*sets)], _Products(*map(np.concatenate, zip(*products, strict=True))))
            for sets, products in whole
        ]

    def _by_size(self, sets: Sequence[Numbers]) -> Iterator[tuple[list[Numbers], _Products]]:
        """Yield sets of causes with as many columns, and the products of these."""
        if not sets:
            return
        every = sorted({k for several in sets for k in several})
        ends = np.cumsum([0, *(self.regressors[k].size for k in every)]).tolist()
        own = {k: [*range(*ends[n : n + 2])] for n, k in enumerate(every)}
        places = {several: [row for k in several for row in own[k]] for several in sets}
        whole = self._products([self.regressors[k] for k in every])
        for size in sorted({len(rows) for rows in places.values()}):
            alike = [several for several in sets if len(places[several]) == size]
            yield alike, whole.some(np.array([places[several] for several in alike]))

    def _products(self, several: Sequence[Regressor]) -> _Products:
        """Return the products of the columns of several causes."""
        whitened = [own.columns.whitened(self.problem.whitening) for own in several]
        columns = -np.concatenate(whitened, axis=2).swapaxes(0, 1)
        usual = block_diag(*(own.usual for own in several))
        left = np.ascontiguousarray(self.fit.residual.T)
        beside, among = self._derivatives @ columns, columns.swapaxes(1, 2) @ columns
        return _Products(beside, among, (left[:, None] @ columns)[:, 0], usual)

    def _density(self, new: _Products, own: Sequence[Effect]) -> tuple[FloatArray, FloatArray]:
        """Return (K,) what causes add to the log density [nats], and their numbers (K, r)."""
        gone, steps = until_null(self.fit, own, self.problem.robot)
        start, covariance = self._normal.step_with(gone, steps), self._normal.covariance_with(gone)
        weights = 1.0 / self.fit.usual.noise
        across = np.einsum("o,kopr->kpr", weights, new.beside)
        taken = covariance @ across
        right = weights @ new.along + start @ across
        told = np.einsum("o,kors->krs", weights, new.among)
        # What is usual in the weights of the fit; drawings are as wrong as is likeliest.
        noise = float(np.min(self.problem.row_noise(self.fit.residual) / self.fit.usual.noise))
        wrong = np.ones(len(told))
        for _ in range(ROUNDS if new.usual.any() else 1):
            inner = told + new.usual * (noise / wrong)[:, None, None]
            size = np.sqrt(np.maximum(np.diagonal(inner, axis1=1, axis2=2), 1e-300))
            apart = (inner - across.swapaxes(1, 2) @ taken) / size[:, :, None] / size[:, None]
            apart += RIDGE * np.eye(size.shape[1])
            numbers = -np.linalg.solve(apart, (right / size)[:, :, None])[:, :, 0] / size
            squares = np.einsum("kr,krs,ks->k", numbers, new.usual, numbers)
            wrong = more_wrong(squares, np.count_nonzero(new.usual.any(axis=1), axis=1)) ** 2
        steps = start - (taken @ numbers[:, :, None])[:, :, 0]
        gram, moment, before = self._sums
        left = before + 2.0 * (steps @ moment.T + np.einsum("kor,kr->ko", new.along, numbers))
        left += np.einsum("okp,kp->ko", steps @ gram, steps)
        left += 2.0 * np.einsum("kp,kopr,kr->ko", steps, new.beside, numbers, optimize=True)
        left += np.einsum("kr,kors,ks->ko", numbers, new.among, numbers, optimize=True)
        means = np.maximum(left, 0.0) / len(self.fit.residual)
        # What a cause more takes away may be all that was correlated.
        samples = self.h.samples if own else self.problem.white_samples
        here = np.mean(self.fit.residual**2, axis=0)
        return density_gained(self.problem, self.h, here, means, samples), numbers
