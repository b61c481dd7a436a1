"""Which formula a joint's rows support: how many terms, which, how surely; how it is said."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Literal, TypeAlias

import numpy as np
from scipy.stats import sem

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.effects import CustomTorque, TorqueTerm
from wbc.files import as_json
from wbc.identification.answer.diagnosis import ErrorLevel, Estimate
from wbc.identification.formulas.term_table import TermTable
from wbc.robot import Effect, Robot
from wbc.tables import FEW, TextTable

_RIDGE = 1e-7
_TRIED = 10  # additions to a support that are fitted
_BEAM = 6  # supports kept per size
_PAIRS = 40
_CANCELLING = 10.0  # squares of the single terms over the square of their sum


@dataclass(frozen=True, eq=False)
class TermSet:
    """Some terms of a table with least-squares coefficients.

    Attributes:
        chosen: numbers of the terms.
        coefficients: one per term.
        loss: sum of squares that is left in the cells of the fit.
    """

    chosen: tuple[int, ...]
    coefficients: FloatArray
    loss: float


class SparseRegression:
    """Least squares with a given number of terms on some cells of a table."""

    def __init__(self, table: TermTable, cells: BoolArray | IntArray) -> None:
        """Sum up the cells, columns scaled to length one.

        Args:
            table: candidates.
            cells: which cells the fit may see.
        """
        self._table = table
        gram = table.gram[cells].sum(axis=0)
        self._scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        whole = np.sqrt(np.diag(table.gram.sum(axis=0)))
        # A column that hardly moves in these cells cannot be learnt from them.
        self._usable = self._scale > 0.02 * whole
        self._gram = gram / np.outer(self._scale, self._scale) + _RIDGE * np.eye(whole.size)
        self._moment = table.moment[cells].sum(axis=0) / self._scale
        self._energy = float(table.energy[cells].sum())

    def path(self, most: int) -> list[TermSet]:
        """Return the best supports found with 0, 1, ..., `most` terms that brake where dry.

        A beam of supports grows by one term at a time, joined by the best of all pairs, since two
        terms may do together what neither does alone.
        """
        best = [TermSet((), np.zeros(0), self._energy)]
        beam: list[tuple[int, ...]] = [()]
        for size in range(1, most + 1):
            offers = [chosen for rest in beam for chosen in self._extensions(rest)]
            offers += self._pairs() if size == 2 else []
            distinct = dict.fromkeys(tuple(sorted(o)) for o in offers)
            found = list(islice(self._allowed(list(distinct)), _BEAM))
            if not found:
                break
            best.append(found[0])
            beam = [support.chosen for support in found]
        return best

    def fitted(self, chosen: Sequence[int]) -> TermSet:
        """Return these terms with their coefficients."""
        return next(self._fits(np.array([chosen], dtype=np.int_)))

    def _fits(self, offers: IntArray) -> Iterator[TermSet]:
        """Yield the supports (S, k) with their coefficients, from the least loss on."""
        gram = self._gram[offers[:, :, None], offers[:, None, :]]
        moment = self._moment[offers]
        solutions = np.linalg.solve(gram, moment[..., None])[..., 0]
        losses = self._energy - np.sum(solutions * moment, axis=1)
        for k in np.argsort(losses, kind="stable"):
            chosen, coefficients = offers[k], solutions[k] / self._scale[offers[k]]
            yield TermSet(tuple(chosen.tolist()), coefficients, float(losses[k]))

    def _extensions(self, rest: Sequence[int]) -> list[tuple[int, ...]]:
        """Return the most promising supports of `rest` and one term more."""
        index = list(rest)
        inverse = np.linalg.inv(self._gram[np.ix_(index, index)])
        across = self._gram[:, index]
        free = np.diag(self._gram) - np.einsum("ci,ij,cj->c", across, inverse, across)
        pull = self._moment - across @ inverse @ self._moment[index]
        usable = self._usable & (free > 1e-5)
        usable[index] = False
        gains = np.where(usable, pull**2 / np.where(usable, free, 1.0), -np.inf)
        order = np.argsort(-gains)[:_TRIED]
        return [(*rest, int(k)) for k in order if usable[k]]

    def _pairs(self) -> list[tuple[int, ...]]:
        """Return the best pairs of all."""
        usable = np.flatnonzero(self._usable)
        gram, b = self._gram[np.ix_(usable, usable)], self._moment[usable]
        free = 1.0 - gram**2
        gain = (b[:, None] ** 2 - 2.0 * gram * np.outer(b, b) + b**2) / np.maximum(free, 1e-5)
        gain[np.tril_indices(usable.size)] = -np.inf
        gain[free < 1e-5] = -np.inf
        best = np.argsort(-gain, axis=None)[:_PAIRS]
        rows, columns = np.unravel_index(best, gain.shape)
        return [(int(usable[i]), int(usable[j])) for i, j in zip(rows, columns, strict=True)]

    def _allowed(self, offers: Sequence[tuple[int, ...]]) -> Iterator[TermSet]:
        """Yield supports of one size from the least loss on.

        Those whose friction drives, or whose terms mostly cancel one another, are left out.
        """
        for support in self._fits(np.array(offers, dtype=np.int_)) if offers else ():
            index = list(support.chosen)
            sizes = support.coefficients * self._scale[index]
            together = float(sizes @ self._gram[np.ix_(index, index)] @ sizes)
            fine = float(sizes @ sizes) <= _CANCELLING * together
            if fine and self._table.possible(index, support.coefficients):
                yield support


def cell_losses(table: TermTable, support: TermSet, cells: BoolArray) -> FloatArray:
    """Return the sum of squares that a support leaves in each of `cells`."""
    index, c = np.asarray(support.chosen, dtype=np.int_), support.coefficients
    explained = 2.0 * table.moment[cells][:, index] @ c
    gram = table.gram[np.ix_(np.flatnonzero(cells), index, index)]
    model = np.einsum("i,kij,j->k", c, gram, c)
    return np.asarray(table.energy[cells] - explained + model)


def block_errors(table: TermTable, losses: FloatArray) -> FloatArray:
    """Return the mean square (blocks,) of cell losses (cells,)."""
    blocks = np.unique(table.blocks, return_inverse=True)[1]
    return np.asarray(np.bincount(blocks, losses) / np.bincount(blocks, table.count))


_Folds: TypeAlias = Sequence[tuple[BoolArray, SparseRegression]]
"""Of every fold its cells and the regression on all others."""


def held_out(table: TermTable, chosen: Sequence[int], folds: _Folds) -> FloatArray:
    """Return errors (blocks,) of these terms, each fold with coefficients of the others."""
    losses = np.zeros(len(table.folds))
    for inside, others in folds:
        losses[inside] = cell_losses(table, others.fitted(chosen), inside)
    return block_errors(table, losses)


MOST_TERMS = 4
_STANDARD_ERRORS = 2.0
_LEAST_GAIN = 0.05  # of the floor's mean square
_LEAST_SHARE = 0.35  # of the excess over the floor: what leaves more is no law of this joint
_WIDER_SHARE = 0.01  # ... that terms of other joints or of logs alone must add
_WIDER_REST = 0.5  # ... and of what formulas without them leave
_SHARE_PER_TERM = 1e-4  # of the square explained: filters distort that much
_STABLE = 0.5  # share of the folds that must choose a term
_SAME = 0.98  # cosine above which two terms are the same choice
_SAME_ERROR = 1e-4  # share by which errors of equal terms differ through rounding


@dataclass(frozen=True, eq=False)
class Formula:
    """Terms for the unexplained torque of one joint.

    Attributes:
        terms: with coefficients from all cells.
        before, after: (blocks,) held-out mean square of the joint in floors, without the formula
            and with one that was chosen and fitted without the fold that judges it.
        stability: share of the folds that choose each term, or one that can hardly be told from it.
        rivals: for each term, products that do as well in its place.
    """

    terms: tuple[TorqueTerm, ...]
    before: FloatArray
    after: FloatArray
    stability: tuple[float, ...]
    rivals: tuple[tuple[str, ...], ...]

    @property
    def share(self) -> float:
        """Share of the excess over the floor that the formula removes from unseen cells."""
        before, after = float(np.mean(self.before)), float(np.mean(self.after))
        return min((before - after) / max(before - 1.0, 1e-12), 1.0)


def find_formula(table: TermTable) -> Formula | None:
    """Return the smallest formula that does as well as the best one on unseen folds, or none.

    Every fold is predicted by terms *and* coefficients that were found without it; formulas of
    zero to four terms are compared block by block. The smallest one within one standard error of
    the best is taken if it beats no formula by two standard errors. Terms of other joints, and
    terms with accelerations or loads, which only logs know, must in addition remove half of what
    formulas without them leave: motions of joints resemble one another.
    """
    best: Formula | None = None
    known = [not term.needs_acceleration for term in table.terms]
    alone = [k and set(t.joints) <= {table.joint} for k, t in zip(known, table.terms, strict=True)]
    for kept in (alone, known, [True] * len(known)):
        formula = _formula(table.only(kept)) if any(kept) else None
        if formula is None:
            continue
        if best is not None:
            least = max(_WIDER_SHARE * _excess(best.before), _WIDER_REST * _excess(best.after))
            if not _pays(best.after, formula.after, least):
                continue
        best = formula
    return best


def _formula(table: TermTable) -> Formula | None:
    cells = [table.folds == fold for fold in np.unique(table.folds)]
    folds = [(inside, SparseRegression(table, ~inside)) for inside in cells]
    paths, errors = _nested(table, folds)
    count, least = _fewest(errors), _LEAST_SHARE * _excess(errors[0])
    if not _pays(errors[0], errors[count], least):
        return None
    everything = SparseRegression(table, np.ones(len(table.folds), dtype=bool))
    for fewer in range(count, 0, -1):
        path = everything.path(fewer)
        if len(path) <= fewer or not _pays(errors[0], errors[fewer], least):
            continue
        support = _simplified(table, folds, everything, path[fewer])
        stability = _stability(table, support, [path[fewer] for path in paths])
        # A term that most folds do without is no law of this joint.
        if min(stability) >= _STABLE:
            return Formula(
                terms=tuple(
                    TorqueTerm(float(c), table.terms[k].factors)
                    for k, c in zip(support.chosen, support.coefficients, strict=True)
                ),
                before=errors[0],
                after=errors[fewer],
                stability=stability,
                rivals=tuple(
                    tuple(table.terms[k].text for k in _ties(table, folds, support, place)[:FEW])
                    for place in range(fewer)
                ),
            )
    return None


def _nested(table: TermTable, folds: _Folds) -> tuple[list[list[TermSet]], list[FloatArray]]:
    """Return each fold's supports, and the errors (blocks,) for every number of terms."""
    paths = [others.path(MOST_TERMS) for _, others in folds]
    losses = np.zeros((min(map(len, paths)), len(table.folds)))
    for (inside, _), path in zip(folds, paths, strict=True):
        losses[:, inside] = [cell_losses(table, own, inside) for own in path[: len(losses)]]
    return paths, [block_errors(table, loss) for loss in losses]


def _fewest(errors: Sequence[FloatArray]) -> int:
    """Return the smallest number of terms within one standard error of the best number."""
    means = [float(np.mean(error)) for error in errors]
    best = int(np.argmin(means))
    slack = _SHARE_PER_TERM * max(means[0] - means[best], 0.0)
    gaps = [error - errors[best] for error in errors]
    return next(k for k, gap in enumerate(gaps) if np.mean(gap) <= max(sem(gap), slack))


def _pays(without: FloatArray, with_it: FloatArray, least: float) -> bool:
    difference, ratio = without - with_it, np.log(without / with_it)
    gain = float(np.mean(difference))
    certain = any(np.mean(x) > _STANDARD_ERRORS * sem(x) for x in (difference, ratio))
    return certain and gain > max(_LEAST_GAIN, least)


def _excess(errors: FloatArray) -> float:
    return max(float(np.mean(errors)) - 1.0, 0.0)


def _simplified(
    table: TermTable, folds: _Folds, everything: SparseRegression, support: TermSet
) -> TermSet:
    """Return the support with every term replaced by the simplest that does as well."""
    chosen = list(support.chosen)
    for place in range(len(chosen)):
        own = complexity(table.terms[chosen[place]], table.joint)
        for k in _ties(table, folds, everything.fitted(chosen), place):
            trial = [*chosen[:place], k, *chosen[place + 1 :]]
            fitted = everything.fitted(trial)
            simpler = complexity(table.terms[k], table.joint) < own
            if simpler and table.possible(fitted.chosen, fitted.coefficients):
                chosen = trial
                break
    return everything.fitted(chosen)


def _ties(table: TermTable, folds: _Folds, support: TermSet, place: int) -> list[int]:
    """Return the terms that do as well in the place of one on held-out folds, best first."""
    own, present = support.chosen[place], held_out(table, support.chosen, folds)
    rest = [k for k in support.chosen if k != own]
    equal, close = _SAME_ERROR * float(np.mean(present)), []
    for k in _alike(table, own, rest):
        error = held_out(table, [*rest, k], folds)
        difference = error - present
        if float(np.mean(difference)) <= max(sem(difference), equal):
            close.append((float(np.mean(error)), k))
    return [k for _, k in sorted(close)]


def _alike(table: TermTable, own: int, rest: Sequence[int]) -> list[int]:
    """Return the terms most like `own` once `rest` has been taken out of both."""
    cosines = _cosines(table, own, rest)
    order = np.argsort(-np.abs(cosines))
    return [int(k) for k in order[:20] if k != own and k not in rest and abs(cosines[k]) > 0.5]


def _cosines(table: TermTable, own: int, rest: Sequence[int]) -> FloatArray:
    gram = table.gram.sum(axis=0)
    index = list(rest)
    ridge = 1e-9 * np.diag(np.diag(gram)[index])
    across = np.linalg.solve(gram[np.ix_(index, index)] + ridge, gram[index])
    left = gram - gram[:, index] @ across
    size = np.sqrt(np.maximum(np.diag(left), 1e-9 * np.diag(gram)))
    return np.asarray(left[own] / (size[own] * size))


def _stability(table: TermTable, support: TermSet, others: Sequence[TermSet]) -> tuple[float, ...]:
    """Return, for each term, the share of other supports that hold it or one just like it."""

    def share(own: int) -> float:
        alike = np.abs(_cosines(table, own, [k for k in support.chosen if k != own])) > _SAME
        alike[own] = True
        return float(np.mean([alike[list(other.chosen)].any() for other in others]))

    return tuple(map(share, support.chosen))


def complexity(term: TorqueTerm, joint: str) -> float:
    """Return how much a term asks one to believe; what a controller cannot know costs most.

    Motion of other joints costs, and friction that would turn round with a position or load.
    """
    powers = [factor for factor in term.factors if factor.shape == "power"]
    dry = any(factor.shape == "sign" for factor in term.factors)
    turning = dry and any(factor.number % 2 == 1 for factor in powers)
    return (
        len(term.factors)
        + 0.5 * sum(factor.number - 1.0 for factor in powers)
        + 0.1 * sum(factor.shape in ("sin", "cos", "size") for factor in term.factors)
        + 0.3 * turning
        + sum(other != joint for other in term.joints)
        + 3.0 * term.needs_acceleration
    )


Outcome = Literal["formula", "partial", "none"]
_SUMMARIES: dict[Outcome, str] = {
    "formula": "These formulas explain what was left; they are proposals, not causes.",
    "partial": "These formulas remove a part only; the rest has a memory or depends on something "
    "outside the library.",
    "none": "No formula found: no product of position, speed, acceleration and load explains what "
    "is left on held-out data.",
}


@dataclass(frozen=True)
class Proposal:
    """A formula for the torque that a model lacks at one joint. A proposal is no cause.

    Attributes:
        effect: the formula, ready to be added to a robot.
        coefficients: value, unit and 90 % interval of each term, by the term's text.
        share: share of the joint's error above the noise floor that the formula removes from logs
            or blocks that neither chose nor fitted it.
        stability: by term, share of the folds that choose it.
        rivals: by term, products that do as well in its place on these logs.
        joints: the joint it acts on first, then those on whose motion it depends.
        warnings: what speaks against believing it.
    """

    effect: CustomTorque
    coefficients: Mapping[str, Estimate]
    share: float
    stability: Mapping[str, float]
    rivals: Mapping[str, tuple[str, ...]]
    joints: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    @property
    def formula(self) -> str:
        """Readable text with units, such as `tau_knee = -0.83 N m * sign(v_knee)`."""
        words = []
        for name, e in self.coefficients.items():
            size = f"{abs(e.value):.3g} {e.unit}".removesuffix(" 1")
            words += ["-" if e.value < 0 else "+", size if name == "1" else f"{size} * {name}"]
        first = words[0].strip("+") + words[1]
        return " ".join([f"tau_{self.effect.where} =", first, *words[2:]])


@dataclass(frozen=True, eq=False)
class Discovery:
    """Formulas for what the named effects leave unexplained.

    Attributes:
        outcome: `formula` (they explain it), `partial` (they remove a part; memory or a quantity
            outside the library is left) or `none` (no formula found).
        proposals: one per joint with a formula.
        known: named effects that stay beside the formulas, refitted.
        dropped: named effects that no longer pay with the formulas, as (name, place).
        error: held-out error without formulas, with them, and the noise floor.
        remainder: what is left, in words; empty when little is.
        robot: the robot with the named effects that stay and the formulas.
        intervals: (effect, where, parameter) -> (low, high), as `save_robot` takes them.
    """

    outcome: Outcome
    proposals: tuple[Proposal, ...]
    known: tuple[Effect, ...]
    dropped: tuple[tuple[str, str], ...]
    error: ErrorLevel
    remainder: str
    robot: Robot
    intervals: Mapping[tuple[str, str, str], tuple[float, float]]

    @property
    def summary(self) -> str:
        """One sentence that says how far to believe it."""
        return _SUMMARIES[self.outcome]

    def rows(self) -> TextTable:
        """Return the terms of the formulas that were proposed."""
        cells: list[tuple[str, ...]] = []
        for proposal in self.proposals:
            cells.append((f"at {proposal.effect.where}: removes {100.0 * proposal.share:.0f} %",))
            for name, e in proposal.coefficients.items():
                folds = f"{100.0 * proposal.stability[name]:.0f} %"
                interval = f"{e.low:.4g} .. {e.high:.4g}"
                cells.append((f"  {name}", f"{e.value:.4g}", interval, e.unit, folds))
        return TextTable.of("~proposed torque|>value|90 % interval|unit|>folds", cells)

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        told = {
            "outcome": self.outcome,
            "summary": self.summary,
            "proposals": [
                {
                    "joints": p.joints,
                    "formula": p.formula,
                    "terms": {
                        name: as_json(e)
                        | {"stability": p.stability[name], "rivals": p.rivals[name]}
                        for name, e in p.coefficients.items()
                    },
                    "share_removed": p.share,
                    "warnings": p.warnings,
                }
                for p in self.proposals
            ],
            "known": [{"effect": e.name, "where": [e.where]} for e in self.known],
            "dropped": [{"effect": name, "where": [where]} for name, where in self.dropped],
            "error": self.error,
            "remainder": self.remainder,
        }
        return dict(as_json(told))
