"""From logs to causes: compare, add what pays, judge what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from wbc.effects import EFFECTS
from wbc.identification.answer.diagnosis import (
    Diagnosis,
    ErrorLevel,
    Step,
)
from wbc.identification.answer.findings import describe_findings
from wbc.identification.answer.ranking import rank_models
from wbc.identification.answer.remainder import describe_remainder
from wbc.identification.answer.verdict import next_experiment
from wbc.identification.choice.causes import find_causes
from wbc.identification.choice.closer_look import look_closer
from wbc.identification.choice.conclusion import conclude
from wbc.identification.choice.hypothesis import Model
from wbc.identification.choice.selection import Selector
from wbc.identification.log_warnings import still_joints, without_copies
from wbc.identification.model.problem import Problem
from wbc.measurement import Log
from wbc.robot import Effect, Robot

_STILL = (
    "{} does not move in these logs: they say nothing about its friction, inertia or gears. Record "
    "it moving back and forth, slowly and fast."
)
_SILENT = (
    "{}: the torque that its drive reports is small, close to its noise, and does not follow what "
    "the motion needs; the joint is set aside. Either it carried too little in these logs to be "
    "judged, or its torque constant, unit or column is wrong."
)
_SERIES = (
    "What was found explains these logs, but as a series does: several of the causes take away "
    "less than a tenth of the error each. Something outside the list is more likely."
)


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
    different, warnings = without_copies(logs)
    problem = Problem.from_logs(robot, different)
    still = still_joints(problem.records)
    nothing_moves = len(still) == robot.transmission.size
    warnings += [
        *problem.warnings,
        *map(_SILENT.format, problem.silent),
        *map(_STILL.format, still),
    ]
    # A robot at rest shows one torque per joint, which anything explains.
    wanted = EFFECTS.values() if candidates is None else candidates
    classes = () if nothing_moves else tuple(wanted)
    found = look_closer(conclude(*find_causes(problem, classes, progress)), robot, different)
    verdict, final, first = found.verdict, found.final, found.path[0]
    left = describe_remainder(found.problem, final.fit) if verdict == "unknown" else ""
    findings = describe_findings(found.problem, final, found.alternatives)
    return Diagnosis(
        verdict=verdict,
        findings=findings,
        next_experiment=next_experiment(verdict, findings, nothing_moves),
        error=ErrorLevel(
            before=float(np.sqrt(first.error)),
            after=float(np.sqrt(final.error)),
            floor=1.0,
            floor_source=problem.floor.source,
        ),
        steps=_steps(found.selector, final, found.path),
        remainder=f"{_SERIES} {left}".strip() if found.series else left,
        robot=final.fit.robot,
        warnings=tuple(warnings),
        ranking=rank_models(found.selector, final, first),
    )


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
    return [e.key for e in one] == [e.key for e in other]
