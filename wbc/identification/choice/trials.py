"""Fits of hypotheses: made once, kept light; a trial that is not finite is dropped and counted."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.drive import in_drive_order
from wbc.errors import IdentificationError
from wbc.identification.choice.evidence import (
    Hypothesis,
    Key,
    asked,
    fold_means,
    implausible,
    weigh,
)
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import ITERATIONS, Fit
from wbc.identification.model.residual import IMPOSSIBLE, beyond_limits
from wbc.identification.model.yielding import some_deflect
from wbc.robot import Effect

# Evidence [nats] that a fit may lack after its first step and still end near its rival. Of 351
# exchanges on 45 generated logs and three recorded machines 260 lacked more, and ended 7.0 nats or
# more behind; of those that lacked 10, one ended 1.0 behind.
HOPELESS = 20.0
_SEEN = 1e-9  # of the longest column: shorter ones are rounding
_KEPT = 5e7  # [bytes] of fits' derivatives. Four recorded arms take no longer than with 2e8.


class OutOfTime(Exception):  # noqa: N818 - no error: the search ends with the best so far
    """The time that was given is over."""


@dataclass(eq=False)
class Trials:
    """Fits hypotheses on one problem.

    Attributes:
        problem: the logs.
        until: time [s] of the monotonic clock from which on nothing more is tried.
        answering: whether the search is over: a hypothesis that is not known by then stays unknown,
            and the answer is made of the others.
        failures: how many trials ended with each error, in words: numbers that are not finite,
            or an error inside an effect.
    """

    problem: EstimationProblem
    until: float = np.inf
    answering: bool = False
    failures: Counter[str] = field(default_factory=Counter)
    _busy: dict[tuple[Effect, ...], tuple[Effect, ...]] = field(default_factory=dict)
    _known: dict[tuple[Effect, ...], Hypothesis | None] = field(default_factory=dict)
    _fits: dict[tuple[Effect, ...], Fit] = field(default_factory=dict)

    @property
    def known(self) -> list[Hypothesis]:
        """Every hypothesis fitted so far."""
        return [h for h in self._known.values() if h is not None]

    @property
    def nothing(self) -> Hypothesis:
        """The robot as given."""
        if () not in self._known:
            fit = self.problem.fit(())
            self._known[()] = hypothesis_of(self.problem, fit)
            self._keep((), fit)
        found = self._known[()]
        if found is None:
            raise IdentificationError("the robot as given leaves what is not finite on these logs.")
        return found

    def of(self, effects: Sequence[Effect], near: Hypothesis | None = None) -> Hypothesis | None:
        """Return the hypothesis fitted from these starts, None where that is impossible.

        Args:
            effects: start values.
            near: a hypothesis whose numbers and derivatives serve where it has the same causes.

        Raises:
            OutOfTime: it is not known yet, and the search must end.
        """
        start = self._start(effects, near)
        if start not in self._known:
            self._known[start] = self._fitted(start, ITERATIONS, near)
        return self._known[start]

    def _start(self, effects: Sequence[Effect], near: Hypothesis | None) -> tuple[Effect, ...]:
        """Return effects with start values, in order, each by the name that it has on the robot.

        Friction of a rotor whose gear loses nothing is friction of its joint: two names for one
        torque would share its odds, and losses next to nothing were kept for the rotor's sake.
        """
        start = in_drive_order(effects if near is None else near.begun(effects))
        if not any(effect.search.otherwise for effect in start):
            return start
        try:
            robot = self.problem.robot.with_effects(*start)
        except IMPOSSIBLE:
            return start
        named: dict[Key, Effect] = {}
        for effect in start:
            other = effect.search.otherwise
            if other is not None and effect.where not in effect.places(robot):
                effect = other.at(effect.where, effect.values)
            named.setdefault(effect.key, effect)
        return tuple(named.values())

    @property
    def hurried(self) -> bool:
        """Whether somebody who interrupted waits for the answer."""
        return self.until == -np.inf

    def ask(self) -> None:
        """Return where there is time: whatever works out a model or columns asks before.

        Raises:
            OutOfTime: there is none.
        """
        if time.monotonic() > self.until:
            raise OutOfTime

    def _fit(
        self, start: tuple[Effect, ...], iterations: int, near: Hypothesis | None
    ) -> Fit | None:
        try:
            self.ask()
            known = None if near is None else self.fit(near)
            fit = self.problem.fit(start, iterations, self.ask, known)
        except IMPOSSIBLE:
            return None
        except OutOfTime:
            if not self.answering:
                raise
            return None
        except Exception as error:  # whatever one effect does, the others are still tried
            self.failures[f"{type(error).__name__}: {error}"] += 1
            return None
        if fit.failed:
            self.failures[fit.failed] += 1
            return None
        return fit

    def _fitted(
        self, start: tuple[Effect, ...], iterations: int, near: Hypothesis | None = None
    ) -> Hypothesis | None:
        fit = self._fit(start, iterations, near)
        if fit is None:
            return None
        try:
            ended = fit.whole and iterations == ITERATIONS
            found = hypothesis_of(self.problem, fit, whole=ended)
        except IMPOSSIBLE:
            return None
        if found.whole:
            self._keep(fit.effects, fit)
        return found

    def all_of(self, offers: Iterable[Sequence[Effect]]) -> list[Hypothesis]:
        """Return the hypotheses fitted from these starts, without the impossible ones."""
        return [found for found in map(self.of, offers) if found is not None]

    def rivals_of(self, h: Hypothesis, offers: Iterable[Sequence[Effect]]) -> list[Hypothesis]:
        """Return hypotheses that may follow another one, without the impossible ones.

        They begin with its numbers. A fit ends after its first step where that leaves it far behind
        the other one.
        """
        known = (self._rival_of(h, self._start(effects, h)) for effects in offers)
        return [found for found in known if found is not None]

    def _rival_of(self, h: Hypothesis, start: tuple[Effect, ...]) -> Hypothesis | None:
        if start in self._known or h.swings or some_deflect(start):
            return self.of(start, h)
        begun = self._fitted(start, 1, h)
        own, other = (0.0, 0.0) if begun is None else weigh(self.problem, [h, begun])
        if begun is not None and other < own - HOPELESS:
            # What it leaves is no noise yet: it does not say how many samples are independent.
            begun = replace(begun, samples=h.samples)
        elif begun is not None:
            begun = self._fitted(begun.effects, ITERATIONS, h) or begun
        self._known[start] = begun
        return begun

    def ended(self, h: Hypothesis) -> Hypothesis:
        """Return a hypothesis that was tried, fitted to its end with derivatives of its own."""
        if h.whole:
            return h
        found = self._known.get(h.effects)
        if found is None or not found.whole:
            found = self._fitted(h.effects, ITERATIONS) or replace(h, whole=True)
            self._known[h.effects] = found
        return found

    def best_of(self, hypotheses: Sequence[Hypothesis]) -> Hypothesis:
        """Return the hypothesis with the most evidence of some, fitted to its end.

        One that nobody believes once it is fitted falls out, but for the first.
        """
        group = list(hypotheses)
        while True:
            best = int(weigh(self.problem, group).argmax())
            ended = self.ended(group[best])
            if ended is group[best]:
                return ended
            group[best] = ended
            group = [h for k, h in enumerate(group) if h.believable or not k]

    def fit(self, hypothesis: Hypothesis, near: Hypothesis | None = None) -> Fit:
        """Return the fit of a hypothesis, made again where it was let go.

        Args:
            hypothesis: that was tried.
            near: another one, of which derivatives are taken then.

        Raises:
            OutOfTime: it was, and the search must end. An answer needs it all the same.
        """
        if hypothesis.effects not in self._fits:
            known = None if near is None else self.fit(near)
            fit = partial(self.problem.fit, hypothesis.effects, near=known)
            self._keep(hypothesis.effects, fit() if self.answering else fit(ask=self.ask))
        return self._fits[hypothesis.effects]

    def busy(self, h: Hypothesis) -> tuple[Effect, ...]:
        """Return the causes of a hypothesis that change something on these logs."""
        if h.effects not in self._busy:
            fit, robot = self.fit(h), self.problem.robot
            size = np.sqrt(np.einsum("rop,rop->p", fit.jacobian, fit.jacobian))
            found = set()
            for (k, parameter), own in zip(fit.parameters, size, strict=True):
                effect = fit.effects[k]
                null = effect.null_of(robot, parameter)
                if own > _SEEN * size.max() and effect.values[parameter.name] != null:
                    found.add(k)
            self._busy[h.effects] = tuple(h.effects[k] for k in sorted(found))
        return self._busy[h.effects]

    def _keep(self, effects: tuple[Effect, ...], fit: Fit) -> None:
        self._fits[effects] = fit
        size = sum(kept.jacobian.nbytes for kept in self._fits.values())
        while size > _KEPT and len(self._fits) > 1:
            size -= self._fits.pop(next(iter(self._fits))).jacobian.nbytes


def hypothesis_of(problem: EstimationProblem, fit: Fit, *, whole: bool = True) -> Hypothesis:
    """Return what comparing a fit with others needs.

    Args:
        problem: the logs.
        fit: to them.
        whole: whether it is at its end.

    Raises:
        FloatingPointError: what it leaves is not finite.
    """
    held = fit.held_out_residual()
    squares = held**2
    beside, cost = fit.usual.beside_open(held, fit.jacobian, fit.parts)
    if not np.all(np.isfinite(squares)):
        raise FloatingPointError("what is left is not finite.")
    rows = np.unique(problem.folds, return_counts=True)[1].astype(float)
    untold = fit.untold()
    quieter, lacks = problem.quieter(fit)
    units = np.linalg.inv(np.delete(problem.whitening, problem.floor.aside, axis=0))
    lost, unheard = _unheard(problem, fit)

    def of_blocks(more: FloatArray | float) -> FloatArray:
        each = ((left @ units + more) ** 2 for left in (held, fit.residual))
        means = [np.apply_along_axis(problem.block_means, 0, own) for own in each]
        return np.asarray(np.max(means, axis=0))

    blocks = of_blocks(0.0)
    return Hypothesis(
        effects=fit.effects,
        folds=fold_means(problem.folds, squares) + quieter,
        beside=fold_means(problem.folds, beside) + quieter + lacks,
        open=cost,
        blocks=problem.block_means(squares.mean(axis=1)),
        samples=problem.independent_samples(fit.residual),
        rows=rows,
        asked=asked(fit.effects, float(untold.sum())),
        implausible=implausible(problem, fit),
        untold=tuple(untold.tolist()),
        contacts=problem.held_contacts(fit),
        squares=blocks,
        reported=of_blocks(lost) if lost.any() else blocks,
        unheard=unheard,
        whole=whole,
    )


def _unheard(problem: EstimationProblem, fit: Fit) -> tuple[FloatArray, FloatArray]:
    """Return (rows, outputs) what reports hold beyond limits, and (outputs,) what that costs.

    See `weigh`, in nats per independent sample.
    """
    left = fit.residual
    if not any("drive" in effect.acts_by for effect in fit.robot.effects):
        return np.zeros_like(left), np.zeros(left.shape[1])
    judged, records = problem.floor.judged, problem.records
    each = [beyond_limits(fit.robot, record) for record in records]
    lost = np.concatenate([r.condense(own) for r, own in zip(records, each, strict=True)])
    sizes = np.abs(np.concatenate(each)[:, judged])
    shares = np.mean(sizes > 0.0, axis=0)
    beyond = sizes.mean(axis=0) / np.maximum(shares, 1e-300)
    rms = np.sqrt(np.maximum(np.mean(left**2, axis=0), 1.0)) * problem.floor.values[judged]
    wider = np.log(np.maximum(beyond / rms, 1e-300)) + 0.5 - 0.5 * np.log(2.0 * np.pi)
    return lost[:, judged], shares * np.maximum(wider, 0.0)
