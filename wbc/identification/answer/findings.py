"""Effects found, with their intervals and what must be said beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.linalg import eigh
from scipy.special import ndtr

from wbc.arrays import FloatArray
from wbc.effects.gear_losses import YieldingGear
from wbc.identification.answer.diagnosis import Alternative, Estimate, Finding
from wbc.identification.answer.model_to_use import Answer
from wbc.identification.answer.ranking import Correlation, correlation_of
from wbc.identification.answer.shown import with_unit
from wbc.identification.choice.certainty import EVEN
from wbc.identification.choice.drop_screen import Normal, until_null
from wbc.identification.choice.evidence import Hypothesis
from wbc.identification.choice.trials import Trials
from wbc.identification.model.columns import STEP, change_along
from wbc.identification.model.estimation_problem import TAIL, EstimationProblem
from wbc.identification.model.fit import Fit, beside_others, scaled
from wbc.identification.model.yielding import rubbing_effects
from wbc.identification.records.record import Record, rows_per_sample
from wbc.robot import Effect, Quantity
from wbc.robot.coordinates import unit_at

_CORRELATED = 0.95
# Half width of an interval, as a share of the value; of numbers of one unit, of the largest.
_VAGUE = 1.0
_MOTOR_SIDE = (
    "{} of this joint rubs at the motor, before this gear: it follows the motor's speed and does "
    "not slow the link. A simulation would have it at the link"
)
_ABSENT = "the model to use predicts better without it"
_VARIES = "its size changes with {}: it may stand in for another law"
_TOLD = 0.5  # standard deviation with the logs over that without them, up to which they tell it
_STRAY = 8.0  # standard deviations between the logs' own values
_STRAY_SHARE = 0.05  # of the value itself, less is no disagreement worth a word
_ROUNDING = 1e-7  # of the largest column: rounding


def describe_findings(trials: Trials, answer: Answer) -> tuple[Finding, ...]:
    """Return the causes of the model to use, and those named beside it, with all there is to say.

    Args:
        trials: of the search.
        answer: the model to use, judged.
    """
    found, used = _findings_of(trials, answer.hypothesis, answer), answer.hypothesis.keys
    others = (key for key in answer.named.keys if key not in used)
    if absent := [key for key in others if answer.support[key].belief >= EVEN]:
        named = _findings_of(trials, answer.named, answer)
        own = (finding for finding in named if finding.effect.key in absent)
        found += [replace(f, warnings=(_ABSENT, *f.warnings)) for f in own]
    return tuple(found)


def _findings_of(trials: Trials, h: Hypothesis, answer: Answer) -> list[Finding]:
    """Return the causes of a hypothesis with intervals, alternatives and warnings.

    Numbers of causes that are believed are those without the doubtful ones, which may do a part of
    their work in the model; intervals hold the numbers of the model, too.
    """
    problem, fit = trials.problem, trials.fit(h)
    related = _moving_together(fit, correlation_of(problem, fit))
    stray = disagreements(problem.records, fit)
    findings = []
    distortion = problem.distortion(fit, hurried=trials.hurried)
    each = estimates_of(problem, fit, distortion, _without_doubtful(problem, fit, answer))
    for k, (used, estimates) in enumerate(zip(fit.effects, each, strict=True)):
        effect = used.with_values({name: e.value for name, e in estimates.items()})
        own = replace(answer.support[effect.key], sized=sized(effect, estimates))
        if own.belief < EVEN:
            findings.append(Finding(effect, estimates, own))
            continue
        quantities, about = quantities_of(problem, fit, k, distortion)
        # Where quantities are told, nobody checks the parameters.
        warnings = [*(about or _vague(effect, estimates))]
        warnings += [*effect.search.remarks(effect, problem.robot)]
        if isinstance(effect, YieldingGear) and effect.friction_side == "motor":
            rubbing = rubbing_effects(fit.robot, effect.where, problem.records[0].motion)
            names = " and ".join(other.name for other in rubbing)
            warnings += [_MOTOR_SIDE.format(names)] if names else []
        warnings += [*related[k], *stray[k]]
        rivals = tuple(Alternative(*rival) for rival in answer.rivals[effect.key])
        if own.varies > 0.0:
            warnings.append(_VARIES.format(own.follows))
        findings.append(Finding(effect, estimates, own, rivals, tuple(warnings), quantities))
    return findings


def sized(effect: Effect, estimates: Mapping[str, Estimate]) -> float:
    """Return the probability that a cause is no cause of size nothing, by its intervals.

    One of its numbers is on the side of nothing on which it was found. An interval that ends where
    the number's range does is as wide there as on its other side. One that ends at nothing because
    the range does tells only that as many standard deviations, or fewer, lie between: half of them
    in the middle. Of numbers that are drawn to what
    is usual combinations are told, often none alone.
    """
    if effect.search.drawn:
        return 1.0
    found = []
    for p in (p for p in effect.parameters if not p.shape):
        e = estimates[p.name]
        beyond = e.value - (p.null if e.given is None else e.given)
        ends = [(e.value - e.low, e.low == p.low), (e.high - e.value, e.high == p.high)]
        (side, cut), (other, _) = ends if beyond > 0.0 else ends[::-1]
        away = TAIL * abs(beyond) / max(side, other * cut, 1e-300)
        found.append(0.5 * away if cut and abs(beyond) >= side else away)
    return float(ndtr(max(found, default=np.inf)))


def _without_doubtful(problem: EstimationProblem, fit: Fit, answer: Answer) -> FloatArray:
    """Return (p,) the steps of a fit's numbers, in their scales, to where doubtful causes are gone.

    To first order: of no shape, and nothing where links are simulated, whose derivatives say
    little.
    """
    doubtful = [e for e in fit.effects if answer.support[e.key].belief < EVEN]
    if fit.swings or not doubtful:
        return np.zeros(len(fit.parameters))
    gone = until_null(fit, doubtful, problem.robot)
    step = Normal.of(fit.known, fit.moment).step_with(*gone)
    stays = [row for row, (_, parameter) in enumerate(fit.parameters) if parameter.shape]
    step[[*gone[0], *stays]] = 0.0
    return step


def estimates_of(
    problem: EstimationProblem,
    fit: Fit,
    distortion: FloatArray | None = None,
    also: FloatArray | float = 0.0,
) -> list[dict[str, Estimate]]:
    """Return the parameters of every effect of a fit with their intervals, by name.

    Args:
        problem: the logs.
        fit: to them.
        distortion: (p,) see `EstimationProblem.distortion`; computed where it is not given.
        also: (p,) steps from the fit's numbers to those that are told, in the parameters' scales;
            intervals hold both.
    """
    found: list[dict[str, Estimate]] = [{} for _ in fit.effects]
    moved = problem.distortion(fit) if distortion is None else distortion
    bounds = problem.interval_bounds(fit, moved, also)
    steps = np.broadcast_to(also, len(bounds)).tolist()
    rows = zip(fit.parameters, bounds, steps, strict=True)
    for (k, parameter), (low, high), step in rows:
        effect = fit.effects[k]
        given = effect.null_of(problem.robot, parameter)
        nothing = parameter.shape or given == parameter.null
        value = effect.values[parameter.name] + step * parameter.scale
        found[k][parameter.name] = Estimate(
            min(max(value, parameter.low), parameter.high),
            unit_at(problem.robot, effect.where, parameter.unit),
            float(low),
            float(high),
            None if nothing else given,
        )
    return found


def _vague(effect: Effect, estimates: Mapping[str, Estimate]) -> list[str]:
    """Return a sentence per parameter that the logs hardly tell, or that is at its bound."""
    texts = []
    sizes: dict[str, float] = {}
    for p in effect.parameters:
        sizes[p.unit] = max(sizes.get(p.unit, 0.0), abs(effect.values[p.name]))
    for p in effect.parameters:
        if (e := estimates.get(p.name)) is None:
            continue
        if (e.low, e.high) == (p.low, p.high):
            stays = with_unit(e.value, e.unit)
            texts.append(f"these logs do not tell {p.name}: it stays at {stays}")
        elif e.value in (p.low, p.high):
            texts.append(f"{p.name} is at the bound {with_unit(e.value, e.unit)}")
        elif e.high - e.low > 2.0 * _VAGUE * sizes[p.unit]:
            span = f"{e.low:.3g} to {with_unit(e.high, e.unit)}"
            texts.append(f"{p.name} is hardly identifiable here: {span}")
    return texts


def _moving_together(fit: Fit, correlation: Correlation) -> list[list[str]]:
    """Return for every effect a sentence per parameter of another that moves with one of its."""
    found: list[list[str]] = [[] for _ in fit.effects]
    matrix = correlation.matrix
    for one, other in zip(*np.nonzero(np.triu(np.abs(matrix), 1) > _CORRELATED), strict=True):
        k, parameter = fit.parameters[one]
        partner, shared = fit.parameters[other]
        drawn = any(e.search.drawn for e in (fit.effects[k], fit.effects[partner]))
        if k != partner and not drawn:
            effect = fit.effects[partner]
            found[k].append(
                f"{parameter.name} and {shared.name} of {effect.name} at {effect.where} move "
                f"together (correlation {matrix[one, other]:.2f}): only their sum is well known"
            )
    return found


def quantities_of(
    problem: EstimationProblem, fit: Fit, k: int, distortion: FloatArray
) -> tuple[dict[str, Estimate], list[str]]:
    """Return the quantities of effect `k` that differ from those given, and sentences on the rest.

    A quantity is stated where the logs know it at least twice as well as its prior does. What is
    stated in the place of another is left out where that one is stated.

    Args:
        problem: the logs.
        fit: of the hypothesis chosen.
        k: number of an effect.
        distortion: (p,) by how much parameters are off, see `EstimationProblem.distortion`.
    """
    effect = fit.effects[k]
    found = effect.search.quantities(effect, problem.robot)
    if not found:
        return {}, []
    given = effect.with_values(effect.null_values(problem.robot, effect.where))
    before = given.search.quantities(given, problem.robot)
    rows = [row for row, (owner, _) in enumerate(fit.parameters) if owner == k]

    def told(effect: Effect) -> FloatArray:
        numbers = effect.search.quantities(effect, problem.robot)
        return np.array([quantity.value for quantity in numbers.values()])

    now, each = told(effect), []
    for row in rows:
        parameter = fit.parameters[row][1]
        value = effect.values[parameter.name]
        step = -STEP if value > 0.0 else STEP  # away from the ends of its range
        after = told(effect.with_values({parameter.name: value + step * parameter.scale}))
        each.append((after - now) / step)
    slopes = np.stack(each, axis=-1)
    usual, known = fit.usual.jacobian[:, rows], beside_others(fit.known, rows)
    alone, after = _spread(usual.T @ usual, slopes), _spread(known, slopes)
    apart = np.linalg.norm(problem.deviations(fit)[:, rows] @ slopes.T, axis=0)
    half = np.hypot(TAIL * np.hypot(apart, after), slopes @ distortion[rows])
    estimates = {
        name: Estimate(
            quantity.value,
            quantity.unit,
            quantity.value - float(half[row]),
            quantity.value + float(half[row]),
            before[name].value,
        )
        for row, (name, quantity) in enumerate(found.items())
        if after[row] < _TOLD * alone[row]
    }
    simple = _simplest(estimates, found)
    differ = {name: e for name, e in simple.items() if not e.low <= before[name].value <= e.high}
    # What the logs know of directions of the p parameters, in units of what is known without them.
    more = eigh(known - usual.T @ usual, usual.T @ usual, eigvals_only=True)
    sentences = [
        f"these logs tell {int(np.sum(more > 1.0 / _TOLD**2 - 1.0))} of its {len(rows)} numbers or "
        "of their combinations; the rest is regularised towards the CAD inertia"
    ]
    if not differ:
        sentences.append("no mass, centre or moment alone differs for certain, only sums of them")
    return differ, sentences


def _spread(information: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return the standard deviations of quantities with these slopes (n, p)."""
    known, size = scaled(information)
    along = slopes / size
    return np.asarray(np.sqrt(np.sum(along.T * np.linalg.solve(known, along.T), axis=0)))


def _simplest(known: Mapping[str, Estimate], found: Mapping[str, Quantity]) -> dict[str, Estimate]:
    """Return what is told without what is only said in the place of it."""
    kept = {}
    for name, estimate in known.items():
        group = [n for n, q in found.items() if q.instead and name.startswith(q.instead)]
        if not group or not all(n in known for n in group):
            kept[name] = estimate
    return kept


def disagreements(records: Sequence[Record], fit: Fit) -> list[list[str]]:
    """Return for every effect a sentence per parameter on whose value the logs disagree.

    Logs of different robots, loads or units show so: each has a value of its own, one Gauss-Newton
    step away from the common one, and is explained by it far better than by the common one.

    Args:
        records: the logs.
        fit: to all of them.
    """
    found: list[list[str]] = [[] for _ in fit.effects]
    if len(records) < 2 or not fit.parameters:
        return found
    ends = np.cumsum([0, *(record.rows for record in records)])
    parts = zip(pairwise(ends), records, strict=True)
    alone = [_alone(fit, slice(*ends), rows_per_sample([own])) for ends, own in parts]
    steps, deviations = (np.array(part) for part in zip(*alone, strict=True))
    for row, (k, parameter) in enumerate(fit.parameters):
        value = fit.effects[k].values[parameter.name]
        own = value + steps[:, row] * parameter.scale
        doubt = _STRAY * float(deviations[:, row].max()) * parameter.scale
        if parameter.shape or np.ptp(own) < max(doubt, _STRAY_SHARE * abs(value)):
            continue
        low, high = int(np.argmin(own)), int(np.argmax(own))
        unit = unit_at(fit.robot, fit.effects[k].where, parameter.unit)
        found[k].append(
            f"the logs disagree on {parameter.name}: {records[low].name} alone says "
            f"{own[low]:.3g}, {records[high].name} {with_unit(own[high], unit, 3)}"
        )
    return found


def _alone(fit: Fit, rows: slice, per_sample: float) -> tuple[FloatArray, FloatArray]:
    """Return the step (p,) to what some rows alone say, and its standard deviation (p,)."""
    step = fit.step(rows)
    left = fit.residual[rows] + change_along(fit.jacobian[rows], step)
    a = fit.jacobian[rows].reshape(-1, len(fit.parameters))
    size = np.sqrt(np.sum(a**2, axis=0))
    seen = size > _ROUNDING * size.max()
    norm = np.where(seen, size, 1.0)
    gram = (a / norm).T @ (a / norm) + 1e-9 * np.eye(norm.size)
    spread = np.sqrt(per_sample * np.mean(left**2) * np.diag(np.linalg.inv(gram)))
    return step, np.where(seen, spread / norm, np.inf)
