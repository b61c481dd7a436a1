"""Proposals with intervals and warnings, from what a search has found."""

from __future__ import annotations

from collections.abc import Mapping

from wbc.effects import CustomTorque, TorqueTerm
from wbc.identification.answer.diagnosis.diagnosis import Estimate
from wbc.identification.formulas.attempt import Attempt
from wbc.identification.formulas.discovery import Proposal
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.intervals import interval_bounds


def estimated(problem: EstimationProblem, fit: Fit) -> dict[tuple[str, str, str], Estimate]:
    """Return every parameter with its interval, by effect, place and name."""
    model = problem.robot.model
    slides = {
        name
        for name in problem.robot.single_joints
        if model.joints[model.getJointId(name)].shortname().startswith("JointModelP")
    }
    bounds = interval_bounds(fit, problem.blocks, problem.distortion(fit))
    result = {}
    for (number, parameter), (low, high) in zip(fit.parameters, bounds, strict=True):
        effect, unit = fit.effects[number], parameter.unit
        if isinstance(effect, CustomTorque):
            unit = TorqueTerm.parse(parameter.name).unit(slides, at_slide=effect.where in slides)
        value = effect.values[parameter.name]
        key = (effect.name, effect.where, parameter.name)
        result[key] = Estimate(value, unit, float(low), float(high))
    return result


def proposals_of(
    found: Attempt, estimates: Mapping[tuple[str, str, str], Estimate]
) -> tuple[Proposal, ...]:
    """Return one proposal per formula.

    Args:
        found: what the search has chosen.
        estimates: every parameter by effect, place and name.
    """
    proposals = []
    for effect in found.fit.effects:
        if not isinstance(effect, CustomTorque):
            continue
        formula = found.formulas[effect.where]
        terms = [term.text for term in effect.terms]
        own = {term: estimates[effect.name, effect.where, term] for term in terms}
        others = dict.fromkeys(joint for term in effect.terms for joint in term.joints)
        others.pop(effect.where, None)
        proposals.append(
            Proposal(
                effect=effect,
                coefficients=own,
                share=formula.share,
                stability=dict(zip(terms, formula.stability, strict=True)),
                rivals=dict(zip(terms, formula.rivals, strict=True)),
                joints=(effect.where, *others),
                warnings=tuple(_warnings(effect, own)),
            )
        )
    return tuple(proposals)


def _warnings(effect: CustomTorque, estimates: Mapping[str, Estimate]) -> list[str]:
    texts = []
    loose = [name for name, e in estimates.items() if e.low <= 0.0 <= e.high]
    if loose:
        texts.append(f"the interval of {', '.join(loose)} holds zero")
    if effect.needs_acceleration:
        texts.append("needs accelerations: for logs only, not for controller or simulator")
    return texts
