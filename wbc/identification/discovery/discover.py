"""Proposing formulas for what no named effect explains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects import CustomTorque, TorqueTerm
from wbc.identification.atoms import evidence
from wbc.identification.diagnosis import ErrorLevel, Estimate
from wbc.identification.discovery.discovery import Discovery, Outcome, Proposal
from wbc.identification.discovery.formula import STABLE, Formula, find_formula
from wbc.identification.discovery.library import torque_terms
from wbc.identification.discovery.term_table import term_table
from wbc.identification.fit import Fit
from wbc.identification.intervals import interval_bounds
from wbc.identification.problem import Problem
from wbc.identification.remainder import describe_remainder
from wbc.measurement import Log
from wbc.robot import Effect, Robot

_EXPLAINED_FLOOR = 1.0  # rms excess over the floor, in floors, below which nothing is left
_EXPLAINED_SHARE = 0.15  # ... and as a share of the first excess

Report = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class _Attempt:
    """Named effects and formulas with their fit.

    Attributes:
        fit: all of them, refitted together; named effects first.
        squares: (rows, outputs) held-out squares in floors.
        formulas: by joint.
    """

    fit: Fit
    squares: FloatArray
    formulas: dict[str, Formula]

    @property
    def error(self) -> float:
        return float(np.mean(self.squares))

    @property
    def known(self) -> tuple[Effect, ...]:
        return tuple(e for e in self.fit.effects if not isinstance(e, CustomTorque))

    @property
    def freedom(self) -> int:
        return sum(effect.freedom for effect in self.fit.effects)


def discover(
    robot: Robot,
    logs: Sequence[Log],
    progress: Report = lambda line: None,
    known: Sequence[Effect] = (),
) -> Discovery:
    """Return formulas for the torque that `robot` lacks, according to `logs`.

    A sparse regression over products of position, velocity, acceleration, load and direction, per
    joint and across the joints of a chain, in the rows in which a diagnosis works.

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
    problem = Problem.from_logs(robot, logs)
    start = _attempt(problem, known, {})
    found = _search(problem, known, progress)
    if known:
        fresh = _search(problem, (), progress)
        found = _preferred(problem, fresh, found)
    found = found if found.formulas else start
    outcome = _outcome(start, found)
    return Discovery(
        outcome=outcome,
        proposals=_proposals(problem, found),
        known=found.known,
        dropped=_dropped(known, found),
        error=ErrorLevel(
            before=float(np.sqrt(start.error)),
            after=float(np.sqrt(found.error)),
            floor=1.0,
            floor_source=problem.floor.source,
        ),
        remainder="" if outcome == "formula" else describe_remainder(problem, found.fit),
        robot=found.fit.robot,
    )


def _attempt(problem: Problem, effects: Sequence[Effect], formulas: dict[str, Formula]) -> _Attempt:
    fit = problem.fit(effects)
    return _Attempt(fit, problem.held_out(fit), formulas)


def _search(problem: Problem, known: Sequence[Effect], progress: Report) -> _Attempt:
    """Return the formulas that pay, joint by joint, the worst joint first."""
    current = _attempt(problem, known, {})
    size = np.mean(problem.residual**2, axis=0) / problem.floor.values**2
    gears = problem.robot.transmission
    for column in np.argsort(-size[: gears.size]):
        joint = gears.joints[int(column)]
        progress(f"searching a formula for {joint}")
        terms = _library(problem, current.fit, joint)
        formula = find_formula(term_table(problem, current.fit, joint, terms))
        if formula is None:
            continue
        effect = CustomTorque(joint, formula.terms)
        effects = (*current.fit.effects, effect)
        wider = _attempt(problem, effects, current.formulas | {joint: formula})
        if problem.significant(current.squares, wider.squares):
            current = wider
            progress(f"{joint}: {' ; '.join(effect.values)}")
    return _pruned(problem, current)


def _library(problem: Problem, fit: Fit, joint: str) -> tuple[TorqueTerm, ...]:
    seen = evidence(fit.robot, problem.records)
    return torque_terms(fit.robot, joint, seen.motions, seen.unexplained)


def _pruned(problem: Problem, attempt: _Attempt) -> _Attempt:
    """Return the attempt without named effects that the formulas have made idle."""
    current = attempt
    for effect in attempt.known if attempt.formulas else ():
        effects = [
            e for e in current.fit.effects if (e.name, e.where) != (effect.name, effect.where)
        ]
        smaller = _attempt(problem, effects, current.formulas)
        if not problem.significant(smaller.squares, current.squares):
            current = smaller
    return current


def _preferred(problem: Problem, fresh: _Attempt, beside: _Attempt) -> _Attempt:
    """Return the attempt that does better; the simpler one where neither does."""
    if not fresh.formulas:
        return beside
    if problem.significant(fresh.squares, beside.squares):
        return beside
    if problem.significant(beside.squares, fresh.squares) or not beside.formulas:
        return fresh
    return min((fresh, beside), key=lambda a: a.freedom)


def _outcome(start: _Attempt, found: _Attempt) -> Outcome:
    if not found.formulas:
        return "none"
    left = np.sqrt(max(found.error - 1.0, 0.0))
    first = np.sqrt(max(start.error - 1.0, 0.0))
    return "partial" if left > max(_EXPLAINED_FLOOR, _EXPLAINED_SHARE * first) else "formula"


def _dropped(known: Sequence[Effect], found: _Attempt) -> tuple[tuple[str, str], ...]:
    kept = {(effect.name, effect.where) for effect in found.known}
    return tuple((e.name, e.where) for e in known if (e.name, e.where) not in kept)


def _proposals(problem: Problem, found: _Attempt) -> tuple[Proposal, ...]:
    fit = found.fit
    bounds = interval_bounds(fit, problem.blocks, problem.distortion(fit))
    slides = _sliding(problem.robot)
    proposals = []
    for number, effect in enumerate(fit.effects):
        if not isinstance(effect, CustomTorque):
            continue
        formula = found.formulas[effect.where]
        spans = [bounds[row] for row, (owner, _) in enumerate(fit.parameters) if owner == number]
        estimates = {
            term.text: Estimate(
                term.coefficient,
                term.unit(slides, at_slide=effect.where in slides),
                float(low),
                float(high),
            )
            for term, (low, high) in zip(effect.terms, spans, strict=True)
        }
        texts = [term.text for term in formula.terms]
        others = dict.fromkeys(joint for term in effect.terms for joint in term.joints)
        others.pop(effect.where, None)
        proposals.append(
            Proposal(
                effect=effect,
                coefficients=estimates,
                share=formula.share,
                stability=dict(zip(texts, formula.stability, strict=True)),
                rivals=dict(zip(texts, formula.rivals, strict=True)),
                joints=(effect.where, *others),
                warnings=tuple(_warnings(effect, formula, estimates)),
            )
        )
    return tuple(proposals)


def _warnings(effect: CustomTorque, formula: Formula, estimates: dict[str, Estimate]) -> list[str]:
    texts = []
    shaky = [t.text for t, s in zip(formula.terms, formula.stability, strict=True) if s < STABLE]
    if shaky:
        texts.append(f"most folds choose another term than {', '.join(shaky)}")
    loose = [name for name, e in estimates.items() if e.low <= 0.0 <= e.high]
    if loose:
        texts.append(f"the interval of {', '.join(loose)} holds zero")
    if effect.needs_acceleration:
        texts.append("needs accelerations: for logs only, not for controller or simulator")
    return texts


def _sliding(robot: Robot) -> frozenset[str]:
    model = robot.model
    return frozenset(
        name
        for name in robot.single_joints
        if "P" in model.joints[model.getJointId(name)].shortname().removeprefix("JointModel")[:1]
    )
