"""From logs to causes: compare, add what pays, judge what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from wbc.effects import EFFECTS
from wbc.identification.diagnosis import (
    Diagnosis,
    ErrorLevel,
    Estimate,
    Finding,
    Step,
    Verdict,
)
from wbc.identification.intervals import interval_bounds
from wbc.identification.problem import Problem
from wbc.identification.ranking import rank_models
from wbc.identification.remainder import describe_remainder
from wbc.identification.residual import deflects
from wbc.identification.selection import Model, Selector
from wbc.measurement import Log
from wbc.robot import Effect, Robot

_UNEXPLAINED_FLOOR = 1.0  # rms excess over the floor, in floors, that counts as unexplained
_DISAGREEMENT = 4.0  # repeated runs differ by so many times what their sensors' noise explains
# A link that bounces in its play is chaotic: no simulation follows it for long.
_UNEXPLAINED_SHARE_SIMULATED = 0.3
_UNEXPLAINED_SHARE = 0.15  # ... and as a share of the first excess
_EXPLAINED = 1.3  # held-out mean square below which effects with a hidden state are not tried


def diagnose(
    robot: Robot,
    logs: Sequence[Log],
    candidates: Sequence[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> Diagnosis:
    """Return which physical effects `robot` lacks, according to `logs`.

    Args:
        robot: the robot that the user believes in.
        logs: one or several logs of the same robot; runs that repeat one another give the noise
            floor.
        candidates: effect classes to consider; default all.
        progress: called with a line of text as the work proceeds.

    Raises:
        IdentificationError: logs that cannot be compared with this robot, or too short ones.
        LogError: a channel is missing.
    """
    problem = Problem.from_logs(robot, logs)
    classes = tuple(EFFECTS.values()) if candidates is None else tuple(candidates)
    selector, path, final = _select(problem, classes, progress)
    before = path[0].error
    alternatives: Sequence[tuple[str, ...]] = [() for _ in final.effects]
    if not unexplained(before, final):
        final, alternatives = selector.settle(final, path[0])
    verdict = judge(problem, before, final, alternatives)
    findings = _findings(problem, final, alternatives)
    return Diagnosis(
        verdict=verdict,
        findings=findings,
        next_experiment=_next_experiment(verdict, findings),
        error=ErrorLevel(
            before=float(np.sqrt(before)),
            after=float(np.sqrt(final.error)),
            floor=1.0,
            floor_source=problem.floor.source,
        ),
        steps=_steps(selector, final, path),
        remainder=describe_remainder(problem, final.fit) if verdict == "unknown" else "",
        robot=final.fit.robot,
        ranking=rank_models(selector, final, path[0]),
    )


def _select(
    problem: Problem, classes: Sequence[type[Effect]], progress: Callable[[str], None]
) -> tuple[Selector, list[Model], Model]:
    """Return the search, its path and the model chosen.

    Effects with a hidden state are simulated, which is slow; they are tried where effects that
    act at once leave something.
    """
    direct = tuple(c for c in classes if not deflects(c))
    selector = Selector(problem, direct, progress)
    path = selector.run()
    final = selector.prune(path[-1], path[0])
    if len(direct) == len(classes) or final.error < _EXPLAINED:
        return selector, path, final
    wider = Selector(problem, tuple(classes), progress)
    wider_path = wider.run()
    wider_final = wider.prune(wider_path[-1], path[0])
    if wider_final.error < final.error and wider.pays(final, wider_final, path[0]):
        return wider, wider_path, wider_final
    return selector, path, final


def unexplained(before: float, final: Model) -> bool:
    """Whether so much is left that the cause must lie outside the candidates."""
    left = np.sqrt(max(final.error - 1.0, 0.0))
    first = np.sqrt(max(before - 1.0, 0.0))
    bouncing = any(deflects(e) for e in final.effects)
    share = _UNEXPLAINED_SHARE_SIMULATED if bouncing else _UNEXPLAINED_SHARE
    return bool(left > max(_UNEXPLAINED_FLOOR, share * first))


def judge(
    problem: Problem, before: float, final: Model, alternatives: Sequence[Sequence[str]]
) -> Verdict:
    """Return the verdict from held-out errors (mean squares in floors)."""
    if unexplained(before, final):
        return "unknown"
    if not final.effects:
        return "none" if problem.floor.excess < _DISAGREEMENT else "not_repeatable"
    return "ambiguous" if any(alternatives) else "named"


def _findings(
    problem: Problem, model: Model, alternatives: Sequence[Sequence[str]]
) -> tuple[Finding, ...]:
    bounds = interval_bounds(model.fit, problem.blocks, problem.distortion(model.fit))
    findings = []
    for k, effect in enumerate(model.effects):
        estimates: dict[str, Estimate] = {}
        warnings = []
        for row, (owner, parameter) in enumerate(model.fit.parameters):
            if owner != k:
                continue
            value = effect.values[parameter.name]
            low, high = (float(x) for x in bounds[row])
            estimates[parameter.name] = Estimate(value, parameter.unit, low, high)
            if value in (parameter.low, parameter.high):
                warnings.append(
                    f"{parameter.name} is at the bound {_with_unit(value, parameter.unit)}"
                )
        findings.append(Finding(effect, estimates, tuple(alternatives[k]), tuple(warnings)))
    return tuple(findings)


def _with_unit(value: float, unit: str) -> str:
    """Return a number and its unit; the unit of a ratio, 1, is not written."""
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def _steps(selector: Selector, final: Model, path: Sequence[Model]) -> tuple[Step, ...]:
    """Return the staircase of the effects that stayed."""
    steps = [Step("", "", float(np.sqrt(path[0].error)))]
    for count in range(1, len(final.effects) + 1):
        chosen = final.effects[:count]
        known = next((m for m in path if _same(m.effects, chosen)), None)
        model = known or (final if count == len(final.effects) else selector.model(chosen))
        steps.append(Step(chosen[-1].name, chosen[-1].where, float(np.sqrt(model.error))))
    return tuple(steps)


def _same(one: Sequence[Effect], other: Sequence[Effect]) -> bool:
    return [(e.name, e.where) for e in one] == [(e.name, e.where) for e in other]


def _next_experiment(verdict: Verdict, findings: Sequence[Finding]) -> str:
    if verdict == "none":
        return "Nothing is missing on these logs; record faster or loaded motions to look further."
    if verdict == "not_repeatable":
        return (
            "Runs that should repeat one another do not: check what changed between them "
            "(temperature, mounting, payload, supply) and record one motion several times."
        )
    if verdict == "unknown":
        return (
            "No known effect explains what is left. Repeat one run exactly, then move one joint "
            "at a time slowly and fast through the same positions."
        )
    texts = []
    for finding in findings:
        if finding.alternatives:
            rivals = [EFFECTS[name].experiment for name in finding.alternatives if name in EFFECTS]
            texts.append(
                f"To tell {finding.effect.name} from {', '.join(finding.alternatives)} at "
                f"{finding.effect.where}: " + " ".join([finding.effect.experiment, *rivals])
            )
    if texts:
        return " ".join(texts)
    return " ".join(dict.fromkeys(f"{f.effect.experiment}" for f in findings))
