"""Formulas for what no named effect explains, clearly labelled as proposals.

A term of a formula is a cause like any other: what a unit of it changes in the residual is a
column, and sets of terms are weighed by the evidence that weighs causes (`choice/evidence.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.effects import CustomTorque, TorqueTerm
from wbc.effects.presliding import travel_of
from wbc.files import as_json
from wbc.identification.answer.diagnosis import ErrorLevel, Estimate
from wbc.identification.answer.findings import estimates_of
from wbc.identification.answer.remainder import describe, remainders
from wbc.identification.choice.candidate_columns import evidence
from wbc.identification.choice.certainty import CERTAIN
from wbc.identification.choice.evidence import Hypothesis, asked, fold_means, weigh
from wbc.identification.choice.trials import hypothesis_of
from wbc.identification.model.columns import change_along
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import condensed_residual, raw_residual
from wbc.identification.records.not_judged import without_torque_sensors
from wbc.identification.records.record import Record, output_names, output_units, rms
from wbc.identification.terms import torque_terms
from wbc.measurement import Log
from wbc.robot import Effect, Evidence, Robot
from wbc.robot.coordinates import slides
from wbc.tables import FEW, TextTable

Outcome = Literal["formula", "partial", "none"]
_SUMMARIES: dict[Outcome, str] = {
    "formula": "These formulas explain what was left; they are proposals, not causes.",
    "partial": "These formulas remove a part only; the rest has a memory or depends on something "
    "outside the library.",
    "none": "No formula found: no product of position, speed, acceleration and load explains what "
    "is left on held-out data.",
}
_EXPLAINED_FLOOR = 1.0  # rms excess over the floor, in floors, below which nothing is left
_EXPLAINED_SHARE = 0.15  # ... and as a share of the first excess
_STILL = 1e-3  # range of motion [rad, m]
_MOST_TERMS = 4
_TRIED = 10  # sets of one size that are weighed, those that explain most of all rows
_LOST = 1e-6  # share of a column's square that must be left beside others
_DRIVING = 0.01  # share of dry friction that may drive: columns of a filter are no exact signs
_NUDGE = 1e-3  # [N m]
_AS_GOOD = float(np.log(CERTAIN / (1.0 - CERTAIN)))  # [nats] by which a certain term is ahead

Report = Callable[[str], None]


@dataclass(frozen=True)
class Proposal:
    """A formula for the torque that a model lacks at one joint. A proposal is no cause.

    Attributes:
        effect: the formula, ready to be added to a robot.
        coefficients: value, unit and 90 % interval of each term, by the term's text.
        share: share of the joint's error above the noise floor that the formula removes from logs
            or blocks that did not fit it.
        stability: by term, share of the folds that it helps to predict.
        rivals: by term, products that these logs do not tell from it.
        joints: the joint it acts on first, then those on whose motion it depends.
    """

    effect: CustomTorque
    coefficients: Mapping[str, Estimate]
    share: float
    stability: Mapping[str, float]
    rivals: Mapping[str, tuple[str, ...]]
    joints: tuple[str, ...]

    @property
    def warnings(self) -> list[str]:
        """What speaks against believing it."""
        loose = [name for name, e in self.coefficients.items() if e.low <= 0.0 <= e.high]
        warnings = [f"the interval of {', '.join(loose)} holds zero"] if loose else []
        if self.effect.needs_acceleration:
            warnings.append("needs accelerations: for logs only, not for controller or simulator")
        return warnings

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
        proposals: one per joint with a formula, in the order of the joints.
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
        return TextTable.of("proposed torque|>value|90 % interval|unit|>folds", cells)

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


@dataclass(frozen=True, eq=False)
class TermTable:
    """What may make up the torque of one joint.

    Attributes:
        joint: a driven one.
        terms: c candidates.
        outputs: (k,) numbers of the judged outputs that feel the joint.
        columns: (rows, k, c) what a unit of each changes there, in floors.
        levels: (samples, c) level of dry friction that a unit of each gives; 0 where smooth.
    """

    joint: str
    terms: tuple[TorqueTerm, ...]
    outputs: IntArray
    columns: FloatArray
    levels: FloatArray

    @classmethod
    def at(cls, problem: EstimationProblem, robot: Robot, joint: str, seen: Evidence) -> TermTable:
        """Return the terms at a joint of `robot`, the shapes of some read off what was seen."""
        terms = torque_terms(robot, joint, seen, problem.records[0].bandwidth.residual)
        parts = [_columns(robot, record, joint, terms) for record in problem.records]
        whole = np.concatenate([columns for columns, _ in parts]) @ problem.whitening
        outputs = np.flatnonzero(whole.any(axis=(0, 1)))
        columns = np.ascontiguousarray(np.swapaxes(whole[:, :, outputs], 1, 2))
        return cls(joint, terms, outputs, columns, np.concatenate([own for _, own in parts]))

    def effect(self, chosen: Sequence[int], coefficients: FloatArray) -> CustomTorque:
        """Return the formula of some terms."""
        numbers = zip(chosen, coefficients.tolist(), strict=True)
        terms = tuple(replace(self.terms[k], coefficient=number) for k, number in numbers)
        return CustomTorque(self.joint, terms)

    def brake(self, chosen: Sequence[int], coefficients: FloatArray) -> bool:
        """Whether the dry friction of these terms brakes nearly everywhere."""
        level = self.levels[:, chosen] @ coefficients
        driving = float(np.sum(np.maximum(-level, 0.0)))
        return driving <= _DRIVING * float(np.sum(np.abs(level)))

    def best(self, fit: Fit, beside: Sequence[int], pairs: bool) -> list[tuple[int, ...]]:
        """Return terms, or pairs, that explain most of all rows beside a fit and other terms."""
        flat = self.columns.reshape(-1, len(self.terms))
        known = fit.jacobian[:, self.outputs].reshape(len(flat), len(fit.parameters))
        basis = np.linalg.qr(np.concatenate([known, flat[:, beside]], axis=1))[0]
        left = flat - basis @ (basis.T @ flat)
        squares = np.sum(left**2, axis=0)
        new = squares > _LOST * np.sum(flat**2, axis=0)
        left = left[:, new] / np.sqrt(squares[new])
        along = fit.residual[:, self.outputs].ravel() @ left
        gains = along**2
        if pairs:
            shared = left.T @ left
            apart = np.maximum(1.0 - shared**2, _LOST)
            both = gains[:, None] + gains - 2.0 * shared * np.outer(along, along)
            gains = np.triu(both / apart, 1)
        order = np.argsort(-gains, axis=None)[:_TRIED]
        numbers = np.flatnonzero(new)[np.stack(np.unravel_index(order, gains.shape), axis=1)]
        return [tuple(own) for own in numbers.tolist()]


def _columns(
    robot: Robot, record: Record, joint: str, terms: Sequence[TorqueTerm]
) -> tuple[FloatArray, FloatArray]:
    """Return columns (rows, c, outputs) in the outputs' units, and levels (rows, c)."""
    motion = record.motion_of(robot)
    nudged = robot.with_effect(CustomTorque.at(joint, {"1": _NUDGE}))
    gain = (raw_residual(nudged, record) - raw_residual(robot, record)) / _NUDGE * record.scale
    felt = np.flatnonzero(np.abs(gain).max(axis=0) > 1e-9)
    known = {f: f.value(robot, motion) for f in {f for term in terms for f in term.factors}}
    sign = np.sign(motion.velocity[:, robot.velocity_index(joint)])
    torque = np.ones((len(sign), len(terms)))
    for k, term in enumerate(terms):
        for factor in term.factors:
            torque[:, k] *= sign if factor is term.direction_of(joint) else known[factor]
    dry = np.array([term.direction_of(joint) is not None for term in terms])
    sure = record.weight[:, felt].min(axis=1, keepdims=True) > 0.5
    columns = np.zeros((record.rows, len(terms), gain.shape[1]))
    for output in felt:
        columns[:, :, output] = record.condense_driven(torque * gain[:, [output]])
    return columns, record.thinned(-torque * sign[:, None] * dry * sure)


@dataclass(frozen=True, eq=False)
class TermSet:
    """Some terms beside a fit, linearly fitted with it.

    Attributes:
        chosen: their numbers.
        coefficients: of each.
        hypothesis: what is left with them.
    """

    chosen: tuple[int, ...]
    coefficients: FloatArray
    hypothesis: Hypothesis


def linear(
    problem: EstimationProblem, found: Found, terms: TermTable, chosen: Sequence[int]
) -> TermSet:
    """Return terms beside what was found, each fold predicted without itself.

    Args:
        problem: the logs.
        found: the fit whose parameters move with them.
        terms: all of the joint.
        chosen: numbers of some.
    """
    fit = found.fit
    added: list[Effect] = [terms.effect(chosen, np.zeros(len(chosen)))] if chosen else []
    slots = [(len(fit.effects), own) for effect in added for own in effect.parameters]
    new = np.zeros((*fit.residual.shape, len(slots)))
    new[:, terms.outputs] = terms.columns[:, :, list(chosen)]
    jacobian = np.concatenate([fit.jacobian, new], axis=2)
    usual = replace(fit.usual, jacobian=np.pad(fit.usual.jacobian, ((0, 0), (0, len(slots)))))
    a = np.concatenate([usual.weighted(jacobian), usual.jacobian])
    b = np.concatenate([(fit.residual * usual.weights).ravel(), usual.residual])
    step = -np.linalg.lstsq(a, b, rcond=None)[0]
    wider = replace(
        fit,
        effects=(*fit.effects, *added),
        parameters=(*fit.parameters, *slots),
        residual=fit.residual + change_along(jacobian, step),
        jacobian=jacobian,
        usual=replace(usual, residual=usual.residual + usual.jacobian @ step),
    )
    folds = fold_means(problem.folds, wider.held_out_residual() ** 2)
    samples = problem.independent_samples(wider.residual)
    learnt = asked(wider.effects)
    left = replace(found.hypothesis, folds=folds, beside=folds, samples=samples, asked=learnt)
    return TermSet(tuple(chosen), step[len(fit.parameters) :], left)


def find_terms(problem: EstimationProblem, found: Found, terms: TermTable) -> tuple[TermSet, float]:
    """Return the set with most evidence beside what was found, and by how much it is ahead of none.

    A set grows by two terms in the place of one, since two may do together what neither does alone.
    The sets of all sizes are weighed together: the best one says how much of what is left is noise.
    """
    path = [linear(problem, found, terms, ())]
    while len(path) <= _MOST_TERMS:
        now = path[-1].chosen
        rests = [[k for k in now if k != one] for one in now] or [[]]
        grown = ((*own, *more) for own in rests for more in terms.best(found.fit, own, bool(now)))
        sets = {tuple(sorted(own)) for own in grown}
        tried = [linear(problem, found, terms, own) for own in sorted(sets)]
        tried = [one for one in tried if terms.brake(one.chosen, one.coefficients)]
        if not tried:
            break
        path.append(tried[int(np.argmax(weigh(problem, [one.hypothesis for one in tried])))])
    gains = weigh(problem, [one.hypothesis for one in path])
    best = int(np.argmax(gains))
    return path[best], float(gains[best] - gains[0])


@dataclass(frozen=True, eq=False)
class Found:
    """Named effects and formulas, refitted together.

    Attributes:
        fit: of all of them; named effects first.
        hypothesis: what it leaves on held-out data.
        proposals: by joint, without numbers.
    """

    fit: Fit
    hypothesis: Hypothesis
    proposals: dict[str, Proposal]

    @classmethod
    def of(
        cls, problem: EstimationProblem, effects: Sequence[Effect], proposals: dict[str, Proposal]
    ) -> Found:
        """Return the fit of named effects and proposed formulas."""
        fit = problem.fit(effects)
        return cls(fit, hypothesis_of(problem, fit), proposals)

    @property
    def known(self) -> tuple[Effect, ...]:
        """The named effects."""
        return tuple(e for e in self.fit.effects if not isinstance(e, CustomTorque))

    def or_better(self, problem: EstimationProblem, other: Found) -> Found:
        """Return the other where it has more evidence."""
        one, two = weigh(problem, [self.hypothesis, other.hypothesis])
        return other if two > one else self


def discover(
    robot: Robot,
    logs: Sequence[Log],
    progress: Report = lambda line: None,
    known: Sequence[Effect] = (),
) -> Discovery:
    """Return formulas for the torque that `robot` lacks, according to `logs`.

    Products of position, velocity, acceleration, load and direction are weighed, per joint and
    across the joints of a chain, in the rows in which a diagnosis works.

    Args:
        robot: the robot that the user believes in.
        logs: one or several logs of the same robot.
        progress: called with a line of text as the work proceeds.
        known: named effects that a diagnosis found; their parameters stay free to move, and they
            are dropped where a formula does their work.

    Raises:
        IdentificationError: logs that cannot be compared with this robot, or too short ones.
        LogError: a channel is missing.
    """
    whole = EstimationProblem.from_logs(robot, logs)
    # A formula is a torque at a joint. A sensor behind the gear sees it without what the gear
    # takes: where one is, its drive is not judged.
    aside = tuple(dict.fromkeys((*whole.floor.aside, *map(int, whole.robot.sensed))))
    if len(whole.floor.aside) < len(aside) < len(whole.floor.covariance):
        behind = replace(whole, floor=replace(whole.floor, aside=aside))
        found = _discovered(behind, progress, known)
        if found.proposals:
            return _with_drives(found, whole)
        whole = EstimationProblem.from_logs(robot, without_torque_sensors(robot, logs))
    return _discovered(whole, progress, known)


def _with_drives(found: Discovery, whole: EstimationProblem) -> Discovery:
    """Return what was found, with what is left between the motors and the sensors."""
    left = rms(condensed_residual(found.robot, whole.records))
    beyond = left > (1.0 + _EXPLAINED_FLOOR) * whole.floor.values
    names, units = output_names(whole.robot), output_units(whole.robot)
    drives = np.intersect1d(whole.robot.sensed, whole.floor.judged)
    texts = [f"{left[k]:.2g} {units[k]} at {names[k]}" for k in drives if beyond[k]]
    if not texts:
        return found
    said = (
        f"between motor and torque sensor {', '.join(texts)} are left, which no torque of a joint "
        "can be: a diagnosis looks there for losses of the gear."
    )
    return replace(found, outcome="partial", remainder=f"{found.remainder} {said}".strip())


def _discovered(problem: EstimationProblem, progress: Report, known: Sequence[Effect]) -> Discovery:
    """Return formulas for what the rows of one problem leave."""
    # Each output by itself: where two share noise, what one lacks would be explained at the other.
    alone = np.diag(np.diag(problem.floor.covariance))
    apart = replace(problem, floor=replace(problem.floor, covariance=alone))
    found = _search(apart, known, progress)
    if known:
        for effect in known if found.proposals else ():
            fewer = [e for e in found.fit.effects if e.key != effect.key]
            found = found.or_better(apart, Found.of(apart, fewer, found.proposals))
        fresh = _search(apart, (), progress)
        found = found.or_better(apart, fresh) if fresh.proposals else found
    start, end = (Found.of(problem, e, found.proposals) for e in (known, found.fit.effects))
    before, after = (float(np.sqrt(one.hypothesis.error)) for one in (start, end))
    first, left = (np.sqrt(max(error**2 - 1.0, 0.0)) for error in (before, after))
    much = left > max(_EXPLAINED_FLOOR, _EXPLAINED_SHARE * first)
    outcome: Outcome = "none" if not found.proposals else "partial" if much else "formula"
    kept = {effect.key for effect in end.known}
    numbers = _estimates(problem, end.fit)
    formulas = {e.where: e for e in end.fit.effects if isinstance(e, CustomTorque)}
    return Discovery(
        outcome=outcome,
        proposals=tuple(
            replace(found.proposals[joint], effect=formula, coefficients=numbers[formula.key])
            for joint in problem.robot.transmission.joints
            if (formula := formulas.get(joint))
        ),
        known=end.known,
        dropped=tuple(e.key for e in known if e.key not in kept),
        error=ErrorLevel(before, after, 1.0, problem.floor.source),
        remainder="" if outcome == "formula" else describe(remainders(problem, end.fit)),
        robot=end.fit.robot,
        intervals={(*key, n): (e.low, e.high) for key in numbers for n, e in numbers[key].items()},
    )


def _search(problem: EstimationProblem, known: Sequence[Effect], progress: Report) -> Found:
    """Return named effects with the formulas that pay, the one with most evidence first."""
    found = Found.of(problem, known, {})
    gears, seen = problem.robot.transmission, evidence(found.fit.robot, problem.records)
    reaches = dict(zip(gears.joints, np.abs(gears.topology) > 0.0, strict=True))
    waiting, offers = dict[str, TermTable](), dict[str, tuple[TermSet, float]]()
    for joint in gears.joints:
        if travel_of(problem.robot, joint, seen.motions) > _STILL:
            progress(f"searching a formula for {joint}")
            terms = TermTable.at(problem, found.fit.robot, joint, seen)
            if terms.outputs.size:
                waiting[joint] = terms
                offers[joint] = find_terms(problem, found, terms)
    while offers:
        joint = max(offers, key=lambda name: offers[name][1])
        terms, (best, _) = waiting.pop(joint), offers.pop(joint)
        if not best.chosen:
            break
        wider = _with_formula(problem, found, terms, best)
        if found.or_better(problem, wider) is wider:
            found = wider
            progress(f"formula at {joint}")
            # Those whose torque reaches a motor that the torque of this one reaches.
            for other in waiting:
                if (reaches[joint] & reaches[other]).any():
                    offers[other] = find_terms(problem, found, waiting[other])
    return found


def _with_formula(
    problem: EstimationProblem, found: Found, terms: TermTable, best: TermSet
) -> Found:
    """Return all that was found with a formula beside it, and what speaks for each term."""
    fit, joint = found.fit, terms.joint
    best = linear(problem, found, terms, best.chosen)  # beside what was found since
    stability, rivals = {}, {}
    for k in best.chosen:
        rest = [other for other in best.chosen if other != k]
        helps = best.hypothesis.folds < linear(problem, found, terms, rest).hypothesis.folds
        stability[terms.terms[k].text] = float(helps[:, terms.outputs].mean())
        others = [own for (own,) in terms.best(fit, rest, pairs=False) if own != k]
        sets = [best, *(linear(problem, found, terms, (*rest, one)) for one in others)]
        own, *odds = weigh(problem, [one.hypothesis for one in sets])
        ranked = sorted(zip(odds, others, strict=True), reverse=True)
        as_good = [terms.terms[one].text for gain, one in ranked if gain > own - _AS_GOOD]
        rivals[terms.terms[k].text] = tuple(as_good[:FEW])
    effect = terms.effect(best.chosen, best.coefficients)
    joints = dict.fromkeys((joint, *(other for term in effect.terms for other in term.joints)))
    wider = Found.of(problem, (*fit.effects, effect), found.proposals)
    before, after = (one.hypothesis.outputs[terms.outputs].mean() for one in (found, wider))
    share = float(min((before - after) / max(before - 1.0, 1e-12), 1.0))
    proposal = Proposal(effect, {}, share, stability, rivals, tuple(joints))
    return replace(wider, proposals={**found.proposals, joint: proposal})


def _estimates(problem: EstimationProblem, fit: Fit) -> dict[tuple[str, str], dict[str, Estimate]]:
    """Return every number with its interval, by effect and name, in units as the joints move."""
    sliding = {name for name in problem.robot.single_joints if slides(problem.robot, name)}
    found = {}
    for effect, own in zip(fit.effects, estimates_of(problem, fit), strict=True):
        if isinstance(effect, CustomTorque):
            units = {t.text: t.unit(sliding, effect.where in sliding) for t in effect.terms}
            own = {name: replace(e, unit=units[name]) for name, e in own.items()}
        found[effect.key] = own
    return found
