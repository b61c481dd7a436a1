"""Proposing formulas for what no named effect explains, one attempt for every place."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from wbc.effects import CustomTorque, TorqueTerm
from wbc.identification.answer.diagnosis import ErrorLevel, Estimate
from wbc.identification.answer.findings import estimates_of
from wbc.identification.answer.remainder import describe, remainders
from wbc.identification.choice.candidate_columns import evidence
from wbc.identification.choice.evidence import log_densities
from wbc.identification.choice.trials import hypothesis_of
from wbc.identification.formulas.formula import Discovery, Formula, Outcome, Proposal, find_formula
from wbc.identification.formulas.term_table import term_table, torque_terms
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.not_judged import without_torque_sensors
from wbc.identification.records.record import output_names, output_units
from wbc.measurement import Log
from wbc.robot import Effect, Robot
from wbc.robot.coordinates import slides

_EXPLAINED_FLOOR = 1.0  # rms excess over the floor, in floors, below which nothing is left
_EXPLAINED_SHARE = 0.15  # ... and as a share of the first excess
_STILL = 1e-3  # range of motion [rad, m]

Report = Callable[[str], None]


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
    whole = EstimationProblem.from_logs(robot, logs)
    behind = _behind_gears(whole)
    if behind is not None:
        found = _discovered(behind, progress, known)
        if found.proposals:
            return _with_drives(found, whole)
    return _discovered(
        EstimationProblem.from_logs(robot, without_torque_sensors(robot, logs)), progress, known
    )


def _behind_gears(problem: EstimationProblem) -> EstimationProblem | None:
    """Return the problem without the drives that have a torque sensor; None without sensors.

    A formula is a torque at a joint. A sensor behind the gear sees it without what the gear takes.
    """
    drives = tuple(map(int, problem.robot.sensed))
    aside = tuple(dict.fromkeys((*problem.floor.aside, *drives)))
    if aside == problem.floor.aside or len(aside) == len(problem.floor.covariance):
        return None
    return replace(problem, floor=replace(problem.floor, aside=aside))


def _with_drives(found: Discovery, whole: EstimationProblem) -> Discovery:
    """Return what was found, with what is left between the motors and the sensors."""
    residual = condensed_residual(found.robot, whole.records)
    left = np.sqrt(np.mean(residual**2, axis=0))
    beyond = left > (1.0 + _EXPLAINED_FLOOR) * whole.floor.values
    names, units = output_names(whole.robot), output_units(whole.robot)
    texts = [
        f"{left[k]:.2g} {units[k]} at {names[k]}"
        for k in map(int, whole.robot.sensed)
        if beyond[k] and k not in whole.floor.aside
    ]
    if not texts:
        return found
    said = (
        f"between motor and torque sensor {', '.join(texts)} are left, which no torque of a joint "
        "can be: a diagnosis looks there for losses of the gear."
    )
    return replace(found, outcome="partial", remainder=f"{found.remainder} {said}".strip())


def _discovered(problem: EstimationProblem, progress: Report, known: Sequence[Effect]) -> Discovery:
    """Return formulas for what the rows of one problem leave."""
    start = Attempt(problem, known, {})
    found = _search(problem, start, progress)
    if known:
        fresh = _search(problem, Attempt(problem, (), {}), progress)
        found = _preferred(problem, fresh, found)
    outcome = _outcome(start, found)
    estimates = estimated(problem, found.fit)
    return Discovery(
        outcome=outcome,
        proposals=tuple(
            proposal_of(effect, found.formulas[effect.where], estimates)
            for effect in found.fit.effects
            if isinstance(effect, CustomTorque)
        ),
        known=found.known,
        dropped=tuple(e.key for e in known if e.key not in {kept.key for kept in found.known}),
        error=ErrorLevel(
            before=float(np.sqrt(start.hypothesis.error)),
            after=float(np.sqrt(found.hypothesis.error)),
            floor=1.0,
            floor_source=problem.floor.source,
        ),
        remainder="" if outcome == "formula" else describe(remainders(problem, found.fit)),
        robot=found.fit.robot,
        intervals={key: (e.low, e.high) for key, e in estimates.items()},
    )


def _search(problem: EstimationProblem, start: Attempt, progress: Report) -> Attempt:
    """Return `start` with the formulas that pay, the one that explains most of its joint first."""
    current, gears = start, problem.robot.transmission
    waiting = list(gears.joints)
    reaches = dict(zip(gears.joints, np.abs(gears.topology) > 0.0, strict=True))
    offers = _offers(problem, current.fit, waiting, progress)
    while offers:
        joint = max(offers, key=lambda name: offers[name].share)
        formula = offers.pop(joint)
        waiting.remove(joint)
        effects = (*current.fit.effects, CustomTorque(joint, formula.terms))
        wider = Attempt(problem, effects, {**current.formulas, joint: formula})
        if better_somewhere(problem, current, wider):
            current = wider
            progress(f"formula at {joint}")
            # Those whose torque reaches a motor that the torque of this one reaches.
            again = [other for other in waiting if (reaches[joint] & reaches[other]).any()]
            offers = {name: offer for name, offer in offers.items() if name not in again}
            offers |= _offers(problem, current.fit, again, progress)
    return _pruned(problem, current)


def _offers(
    problem: EstimationProblem, fit: Fit, joints: Sequence[str], progress: Report
) -> dict[str, Formula]:
    """Return the formula of every joint that has one."""
    band = problem.records[0].bandwidth.residual
    seen = evidence(fit.robot, problem.records)
    found = {}
    for joint in joints:
        column = problem.robot.position_index(joint)
        if max(np.ptp(motion.position[:, column]) for motion in seen.motions) <= _STILL:
            continue  # a joint that stands still shows no law
        progress(f"searching a formula for {joint}")
        terms = torque_terms(fit.robot, joint, seen.motions, seen.unexplained, band)
        formula = find_formula(term_table(problem, fit, joint, terms))
        if formula is not None:
            found[joint] = formula
    return found


def _pruned(problem: EstimationProblem, attempt: Attempt) -> Attempt:
    """Return the attempt without named effects that the formulas have made idle."""
    current = attempt
    for effect in attempt.known if attempt.formulas else ():
        effects = [e for e in current.fit.effects if e.key != effect.key]
        smaller = Attempt(problem, effects, current.formulas)
        if not better_somewhere(problem, smaller, current):
            current = smaller
    return current


def _preferred(problem: EstimationProblem, fresh: Attempt, beside: Attempt) -> Attempt:
    """Return formulas instead of the named effects where they do no worse, else beside them."""
    if not fresh.formulas or better_somewhere(problem, fresh, beside):
        return beside
    if better_somewhere(problem, beside, fresh):
        return fresh
    # Names are worth more than formulas that explain the same.
    own, other = (sum(e.search.freedom(e) for e in one.fit.effects) for one in (fresh, beside))
    return fresh if beside.formulas and own < other else beside


def _outcome(start: Attempt, found: Attempt) -> Outcome:
    if not found.formulas:
        return "none"
    left, first = (np.sqrt(max(one.hypothesis.error - 1.0, 0.0)) for one in (found, start))
    return "partial" if left > max(_EXPLAINED_FLOOR, _EXPLAINED_SHARE * first) else "formula"


class Attempt:
    """Named effects and formulas with their fit.

    Attributes:
        fit: all of them, refitted together; named effects first.
        hypothesis: what it leaves on held-out data.
        formulas: by joint.
        known: the named effects.
    """

    def __init__(
        self, problem: EstimationProblem, effects: Sequence[Effect], formulas: Mapping[str, Formula]
    ) -> None:
        """Fit `effects`, which hold the `formulas`, to all records of `problem`."""
        self.fit = problem.fit(effects)
        self.hypothesis, self.formulas = hypothesis_of(problem, self.fit), formulas
        self.known = tuple(e for e in self.fit.effects if not isinstance(e, CustomTorque))


def better_somewhere(problem: EstimationProblem, worse: Attempt, better: Attempt) -> bool:
    """Whether the evidence at one output outweighs what more is asked to be believed.

    An output that both leave unexplained does not hide another one at which they differ.
    """
    one, other = log_densities(problem, [worse.hypothesis, better.hypothesis])
    asked = worse.hypothesis.prior - better.hypothesis.prior
    return bool(np.max(other - one) > asked)


def estimated(problem: EstimationProblem, fit: Fit) -> dict[tuple[str, str, str], Estimate]:
    """Return every parameter with its interval, by effect, place and name."""
    sliding = {name for name in problem.robot.single_joints if slides(problem.robot, name)}
    result = {}
    for effect, own in zip(fit.effects, estimates_of(problem, fit), strict=True):
        for name, e in own.items():
            if isinstance(effect, CustomTorque):
                unit = TorqueTerm.parse(name).unit(sliding, at_slide=effect.where in sliding)
                e = replace(e, unit=unit)
            result[effect.name, effect.where, name] = e
    return result


def proposal_of(
    effect: CustomTorque, formula: Formula, estimates: Mapping[tuple[str, str, str], Estimate]
) -> Proposal:
    """Return a formula as it is proposed.

    Args:
        effect: the formula, refitted.
        formula: as it was found.
        estimates: every parameter by effect, place and name.
    """
    own = {term.text: estimates[*effect.key, term.text] for term in effect.terms}
    joints = [effect.where, *(joint for term in effect.terms for joint in term.joints)]
    warnings = []
    loose = [name for name, e in own.items() if e.low <= 0.0 <= e.high]
    if loose:
        warnings.append(f"the interval of {', '.join(loose)} holds zero")
    if effect.needs_acceleration:
        warnings.append("needs accelerations: for logs only, not for controller or simulator")
    return Proposal(
        effect=effect,
        coefficients=own,
        share=formula.share,
        stability=dict(zip(own, formula.stability, strict=True)),
        rivals=dict(zip(own, formula.rivals, strict=True)),
        joints=tuple(dict.fromkeys(joints)),
        warnings=tuple(warnings),
    )
