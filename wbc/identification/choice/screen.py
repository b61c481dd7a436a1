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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.choice.candidate_columns import Regressor, evidence, make_regressors
from wbc.identification.choice.drop_screen import Normal, cheaper, until_null
from wbc.identification.choice.evidence import Hypothesis, Key, density_gained
from wbc.identification.model.columns import drawn
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import RIDGE, Fit
from wbc.identification.model.residual import evaluate
from wbc.robot import Effect, Evidence

_TOGETHER = 64  # columns that are multiplied at once
_BUILT = 40  # causes whose numbers are looked at, those that add most density first
_WHOLE = "robot"  # where effects sit that have no place


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
    """Products of the columns of K causes, r each, at every output."""

    beside: FloatArray
    """(K, outputs, p, r) with the derivatives of the fit."""
    among: FloatArray
    """(K, outputs, r, r) with one another."""
    along: FloatArray
    """(K, outputs, r) with what is left."""
    usual: FloatArray
    """(K, r, r) normal equations of what is usual."""

    def some(self, columns: IntArray) -> _Products:
        """Return the products of choices (K, s) of the columns of the first cause."""
        rows, others = columns[:, :, None], columns[:, None]
        return _Products(
            self.beside[0][:, :, columns].transpose(2, 0, 1, 3),
            self.among[0][:, rows, others].swapaxes(0, 1),
            self.along[0][:, columns].swapaxes(0, 1),
            self.usual[0][rows, others],
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
        places = {effect.where for effect in fit.effects if drawn(effect)}
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
        density, numbers = self._gained(own)
        found: dict[Key, Proposed] = {}
        for k in np.argsort(-density).tolist():
            key = self.regressors[k].key
            if key not in found and key not in taken:
                made = self._proposed((k,), float(density[k]), numbers[k], own)
                found |= {} if made is None else {key: made}
            if len(found) == _BUILT:
                break
        return sorted(found.values(), key=lambda one: -one.gain)[:count]

    def drawings(self, taken: Sequence[Key]) -> list[Proposed]:
        """Return the best of every effect that is drawn to what is usual.

        Derivatives say little of it, and many others imitate a part each.
        """
        density, numbers = self._gained(())
        found: dict[type[Effect], Proposed] = {}
        for k in np.argsort(-density).tolist():
            own = self.regressors[k]
            if own.drawn and own.effect not in found and own.key not in taken:
                made = self._proposed((k,), float(density[k]), numbers[k], ())
                found |= {} if made is None else {own.effect: made}
        return list(found.values())

    def together(self, sets: Sequence[tuple[int, ...]], count: int) -> list[Proposed]:
        """Return what sets of causes, by number, add together where a robot can have them.

        Args:
            sets: of causes that are looked at together.
            count: how many are returned at most, those that add most density.
        """
        if not sets:
            return []
        every = sorted({k for several in sets for k in several})
        ends = np.cumsum([0, *(self.regressors[k].size for k in every)]).tolist()
        own = {k: [*range(*ends[n : n + 2])] for n, k in enumerate(every)}
        whole = self._products([self._columns(every)], [self._usual_of(every)])[0]
        groups: dict[int, list[tuple[int, ...]]] = {}
        for several in sets:
            groups.setdefault(sum(len(own[k]) for k in several), []).append(several)
        found: list[tuple[float, tuple[int, ...], FloatArray]] = []
        for alike in groups.values():
            places = np.array([[row for k in several for row in own[k]] for several in alike])
            density, numbers = self._density(whole.some(places), ())
            found += zip(density.tolist(), alike, numbers, strict=True)
        found.sort(key=lambda one: -one[0])
        best: dict[frozenset[Key], Proposed] = {}
        for gain, several, numbers in found:
            keys = frozenset(self.regressors[k].key for k in several)
            made = None if keys in best else self._proposed(several, gain, numbers, ())
            best |= {} if made is None else {keys: made}
            if len(best) == count:
                break
        return list(best.values())

    def in_all_gears(self, taken: Sequence[Key]) -> list[tuple[int, ...]]:
        """Return every effect in its best shape at all joints at which it can be.

        One cause in all gears is a simpler story than two different ones.
        """
        density, numbers = self._gained(())
        groups: dict[str, dict[str, int]] = {}
        for k in np.argsort(-density).tolist():
            own = self.regressors[k]
            if own.where in self.problem.robot.transmission.joints and own.key not in taken:
                best = groups.setdefault(own.effect.name, {})
                if own.where not in best and own.build(self.fit.robot, numbers[k]) is not None:
                    best[own.where] = k
        return [(*best.values(),) for best in groups.values() if len(best) > 1]

    def pairs(self, taken: Sequence[Key]) -> Iterator[list[tuple[int, ...]]]:
        """Yield all pairs of causes at every place."""
        groups: dict[str, list[int]] = {}
        for k, own in enumerate(self.regressors):
            if own.key not in taken:
                groups.setdefault(own.where, []).append(k)
        for group in groups.values():
            pairs = combinations(group, 2)
            yield [p for p in pairs if len({self.regressors[k].key for k in p}) == len(p)]

    def _proposed(
        self, several: tuple[int, ...], density: float, numbers: FloatArray, own: Sequence[Effect]
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

    def _columns(self, several: Sequence[int]) -> FloatArray:
        """Return (outputs, rows, r) by which the units of causes change the residual."""
        each = [self.regressors[k].columns.whitened(self.problem.whitening) for k in several]
        return -np.concatenate(each, axis=2).swapaxes(0, 1)

    def _usual_of(self, several: Sequence[int]) -> FloatArray:
        """Return (r, r) normal equations of what is usual of causes, in the weights of the fit."""
        size = sum(self.regressors[k].size for k in several)
        usual, first = np.zeros((size, size)), 0
        for own in (self.regressors[k] for k in several):
            places = slice(first, first := first + own.size)
            usual[places, places] = own.usual
        noise = self.problem.row_noise(self.fit.residual) / self.fit.usual.noise
        return np.asarray(usual * float(noise.min()))

    @cached_property
    def _derivatives(self) -> FloatArray:
        """(outputs, p, rows) of the fit."""
        return np.ascontiguousarray(self.fit.jacobian.transpose(1, 2, 0))

    @cached_property
    def _normal(self) -> Normal:
        return Normal.of(self.fit.known, self.fit.moment)

    @cached_property
    def _sums(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(outputs, p, p), (outputs, p), (outputs,) products of derivatives and residual."""
        by_output, left = self._derivatives, self.fit.residual.T
        moment = (by_output @ left[:, :, None])[:, :, 0]
        return by_output @ by_output.swapaxes(1, 2), moment, np.sum(left**2, axis=1)

    def _products(
        self, columns: Sequence[FloatArray], usual: Sequence[FloatArray]
    ) -> list[_Products]:
        """Return the products of columns (outputs, rows, r) of each of some causes."""
        left, found = np.ascontiguousarray(self.fit.residual.T), []
        whole = self._derivatives @ np.concatenate(columns, axis=2)
        ends = np.cumsum([own.shape[2] for own in columns])[:-1]
        for own, beside, known in zip(columns, np.split(whole, ends, axis=2), usual, strict=True):
            among = own.swapaxes(1, 2) @ own
            along = (left[:, None] @ own)[:, 0]
            found.append(_Products(beside[None], among[None], along[None], known[None]))
        return found

    @cached_property
    def _by_size(self) -> list[tuple[list[int], _Products]]:
        """The numbers of all causes with as many columns, and their products."""
        groups: dict[int, tuple[list[int], list[_Products]]] = {}
        batch: list[int] = []
        for k in range(len(self.regressors)):
            batch.append(k)
            full = sum(self.regressors[n].size for n in batch) >= _TOGETHER
            if full or k == len(self.regressors) - 1:
                columns = [self._columns([n]) for n in batch]
                made = self._products(columns, [self._usual_of([n]) for n in batch])
                for n, own in zip(batch, made, strict=True):
                    numbers, products = groups.setdefault(self.regressors[n].size, ([], []))
                    numbers.append(n)
                    products.append(own)
                batch = []
        return [
            (numbers, _Products(*(np.concatenate(part) for part in zip(*each, strict=True))))
            for numbers, each in groups.values()
        ]

    def _gained(self, own: Sequence[Effect]) -> tuple[FloatArray, list[FloatArray]]:
        """Return what each cause adds to the log density [nats], and its numbers."""
        density, found = np.zeros(len(self.regressors)), [np.zeros(0)] * len(self.regressors)
        for numbers, products in self._by_size:
            density[numbers], each = self._density(products, own)
            for k, one in zip(numbers, each, strict=True):
                found[k] = one
        return density, found

    def _density(self, new: _Products, own: Sequence[Effect]) -> tuple[FloatArray, FloatArray]:
        """Return (K,) what causes add to the log density [nats], and their numbers (K, r)."""
        start, covariance = self._normal.with_steps(*until_null(self.fit, own, self.problem.robot))
        weights = 1.0 / self.fit.usual.noise
        across = np.einsum("o,kopr->kpr", weights, new.beside)
        inner = np.einsum("o,kors->krs", weights, new.among) + new.usual
        taken = covariance @ across
        right = weights @ new.along + start @ across
        size = np.sqrt(np.maximum(np.diagonal(inner, axis1=1, axis2=2), 1e-300))
        apart = (inner - across.swapaxes(1, 2) @ taken) / size[:, :, None] / size[:, None]
        apart += RIDGE * np.eye(size.shape[1])
        numbers = -np.linalg.solve(apart, (right / size)[:, :, None])[:, :, 0] / size
        steps = start - (taken @ numbers[:, :, None])[:, :, 0]
        gram, moment, squares = self._sums
        left = squares + 2.0 * (steps @ moment.T + np.einsum("kor,kr->ko", new.along, numbers))
        left += np.einsum("okp,kp->ko", steps @ gram, steps)
        left += 2.0 * np.einsum("kp,kopr,kr->ko", steps, new.beside, numbers, optimize=True)
        left += np.einsum("kr,kors,ks->ko", numbers, new.among, numbers, optimize=True)
        means = np.maximum(left, 0.0) / len(self.fit.residual)
        # What a cause more takes away may be all that was correlated.
        samples = self.h.samples if own else self.problem.white_samples
        here = np.mean(self.fit.residual**2, axis=0)
        return density_gained(self.problem, self.h, here, means, samples), numbers
