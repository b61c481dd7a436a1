"""Effects found, with their intervals and what must be said beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wbc.effects.gear.yielding_gear import YieldingGear
from wbc.identification.answer.diagnosis.absent_ties import absent_ties
from wbc.identification.answer.diagnosis.correlation import Correlation
from wbc.identification.answer.diagnosis.diagnosis import Alternative, Estimate, Finding
from wbc.identification.answer.diagnosis.quantities import quantities_of
from wbc.identification.answer.numbers import with_unit
from wbc.identification.choice.weighing.certainty import Support
from wbc.identification.choice.weighing.hypothesis import Key
from wbc.identification.force_sensors import force_sensor_doubts
from wbc.identification.log_warnings import disagreements
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.intervals import interval_bounds
from wbc.identification.model.link_friction import rubbing_effects
from wbc.robot import Effect, Parameter
from wbc.robot.coordinates import unit_at

_CORRELATED = 0.95
# Half width of an interval, as a share of the value; of numbers of one unit, of the largest.
_VAGUE = 1.0
_MOTOR_SIDE = (
    "{} of this joint rubs at the motor, before this gear: it follows the motor's speed and does "
    "not slow the link. A simulation would have it at the link"
)


def describe_findings(
    problem: EstimationProblem,
    fit: Fit,
    support: Mapping[Key, Support],
    alternatives: Sequence[Sequence[Key]],
    correlation: Correlation,
    classes: Sequence[type[Effect]] = (),
) -> tuple[Finding, ...]:
    """Return the effects of a model with intervals, alternatives and warnings.

    Args:
        problem: the logs.
        fit: of the hypothesis chosen.
        support: of its causes.
        alternatives: for each effect, names and places of what it cannot be told from.
        correlation: of the parameters.
        classes: the candidates, of which some may be tied to what was found.
    """
    distortion = problem.distortion(fit)
    bounds = interval_bounds(fit, problem.blocks, distortion)
    related = _moving_together(fit, correlation)
    stray = disagreements(problem.records, fit)
    sensors = force_sensor_doubts(problem, fit)
    tied = absent_ties(problem, fit, classes)
    findings = []
    for k, effect in enumerate(fit.effects):
        estimates: dict[str, Estimate] = {}
        warnings = []
        given = effect.null_values(problem.robot, effect.where)
        for row, (owner, parameter) in enumerate(fit.parameters):
            if owner != k:
                continue
            value = effect.values[parameter.name]
            unit = unit_at(problem.robot, effect.where, parameter.unit)
            low, high = (float(x) for x in bounds[row])
            estimates[parameter.name] = Estimate(
                value, unit, low, high, _of_the_robot(parameter, given)
            )
            size = max(
                abs(effect.values[p.name]) for p in effect.parameters if p.unit == parameter.unit
            )
            if (low, high) == (parameter.low, parameter.high):
                stays = with_unit(value, unit)
                warnings.append(f"these logs do not tell {parameter.name}: it stays at {stays}")
            elif value in (parameter.low, parameter.high):
                warnings.append(f"{parameter.name} is at the bound {with_unit(value, unit)}")
            elif high - low > 2.0 * _VAGUE * size:
                span = f"{low:.3g} to {with_unit(high, unit)}"
                warnings.append(f"{parameter.name} is hardly identifiable here: {span}")
        quantities, about = quantities_of(problem, fit, k, distortion)
        if about:
            warnings = []  # they are about parameters that nobody checks
        warnings += [*about, *effect.search.remarks(effect, problem.robot)]
        warnings += [*_motor_side(effect, problem, fit), *related[k], *tied[k]]
        warnings += [*stray[k], *sensors[k]]
        rivals = tuple(Alternative(*key) for key in alternatives[k])
        own = support[effect.key]
        findings.append(Finding(effect, estimates, own, rivals, tuple(warnings), quantities))
    return tuple(findings)


def _of_the_robot(parameter: Parameter, given: Mapping[str, float]) -> float | None:
    """Return what the robot has in a parameter's place; None where it has nothing of the kind."""
    value = given.get(parameter.name, parameter.null)
    return None if parameter.shape or value == parameter.null else value


def _motor_side(effect: Effect, problem: EstimationProblem, fit: Fit) -> list[str]:
    """Return a sentence beside a gear that yields and whose friction rubs at the motor."""
    if not isinstance(effect, YieldingGear) or effect.friction_side != "motor":
        return []
    rubbing = rubbing_effects(fit.robot, effect.where, problem.records[0].motion)
    return [_MOTOR_SIDE.format(" and ".join(other.name for other in rubbing))] if rubbing else []


def _moving_together(fit: Fit, correlation: Correlation) -> list[list[str]]:
    """Return for every effect a sentence per parameter of another that moves with one of its."""
    found: list[list[str]] = [[] for _ in fit.effects]
    matrix = correlation.matrix
    for one, other in zip(*np.nonzero(np.triu(np.abs(matrix), 1) > _CORRELATED), strict=True):
        k, parameter = fit.parameters[one]
        partner, shared = fit.parameters[other]
        drawn = any(e.search.departures(e).size for e in (fit.effects[k], fit.effects[partner]))
        if k != partner and not drawn:
            effect = fit.effects[partner]
            found[k].append(
                f"{parameter.name} and {shared.name} of {effect.name} at {effect.where} move "
                f"together (correlation {matrix[one, other]:.2f}): only their sum is well known"
            )
    return found
