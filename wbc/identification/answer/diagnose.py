"""From logs to an answer: prepare, search, say."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from wbc.effects import EFFECTS
from wbc.identification.answer.attainable import Attainable
from wbc.identification.answer.diagnosis import Diagnosis, ErrorLevel, OutputLevel, Step
from wbc.identification.answer.findings import describe_findings
from wbc.identification.answer.model_to_use import Answer, model_to_use
from wbc.identification.answer.ranking import correlation_of, rank_hypotheses, with_covariances
from wbc.identification.answer.remainder import describe, remainders
from wbc.identification.answer.shown import series_of
from wbc.identification.answer.verdict import (
    NOTHING_MOVES,
    explained_share,
    next_experiment,
    verdict_of,
)
from wbc.identification.choice.find_causes import (
    INTERRUPTED,
    SearchResult,
    find_causes,
    look_closer,
)
from wbc.identification.choice.weighing.hypothesis import Hypothesis
from wbc.identification.choice.weighing.trials import Trials
from wbc.identification.log_warnings import still_joints, without_copies
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.not_judged import without_links
from wbc.identification.records.outputs import output_names, output_units
from wbc.measurement import Log
from wbc.robot import Effect, Robot

_SEARCH = 0.8  # of the time that is given
_LAST = 1.0  # [s] for what the answer still needs once the time is over
_STILL = (
    "{} does not move in these logs: they say nothing about its friction, inertia or gears. Record "
    "it moving back and forth, slowly and fast."
)
_SILENT = (
    "{}: the torque that its drive reports is small, close to its noise, and does not follow what "
    "the motion needs; the joint is set aside. Either it carried too little in these logs to be "
    "judged, or its torque constant, unit or column is wrong."
)
_SEVERAL_SILENT = (
    "{}: the torques that their drives report are small, close to their noise, and do not follow "
    "what the motion needs; these joints are set aside. Either they carried too little in these "
    "logs to be judged, or a torque constant, unit or column is wrong at each."
)
_ALL_SILENT = (
    "{}: no drive reports more than noise. The torques do not follow what the motion needs, so no "
    "cause is looked for. Either the joints carried too little in these logs, or a torque "
    "constant, unit, column or clock is wrong."
)


def diagnose(
    robot: Robot,
    logs: Sequence[Log],
    candidates: Sequence[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda line: None,
    budget: float = inf,
) -> Diagnosis:
    """Return which physical effects `robot` lacks, according to `logs`.

    When its time is over, or at Ctrl-C, the answer is the best so far, and a warning says so: it
    is made of what is known then, and of what the next second tells. An effect that raises an
    error is left out, and a warning says so.

    Args:
        robot: the robot that the user believes in.
        logs: one or several logs of the same robot; runs that repeat one another give the noise
            floor.
        candidates: effect classes to consider; default all.
        progress: called with a line of text as the work proceeds.
        budget: time [s] for all of it. A fifth of it is kept for the answer.

    Raises:
        IdentificationError: logs that cannot be compared with this robot, or too short ones.
        LogError: a channel is missing.
    """
    begun = time.monotonic()
    different, warnings = without_copies(logs)
    problem = EstimationProblem.from_logs(robot, different)
    still = still_joints(problem.records)
    nothing_moves = len(still) == robot.transmission.size
    all_silent = bool(problem.silent) and set(problem.judged_joints) <= set(problem.silent)
    warnings += [
        *problem.warnings,
        *about_silent(problem.silent, every=all_silent),
        *map(_STILL.format, still),
    ]
    # A robot at rest shows one torque per joint, which anything explains. So does what is no torque
    # of the motion: on a recorded pendulum a soft gear that its other logs contradict was certain.
    wanted = EFFECTS.values() if candidates is None else candidates
    classes = () if nothing_moves or all_silent else tuple(wanted)
    found = find_causes(problem, classes, progress, begun + _SEARCH * budget)
    found = look_closer(found, different, classes, progress)
    answer, found = _answered(found, classes, begun + budget)
    warnings += _about_the_search(found)
    trials = found.trials
    problem, first = trials.problem, trials.nothing
    final, odds, support = answer.hypothesis, answer.odds, answer.support
    verdict = verdict_of(problem, first, final, list(support.values()), answer.more)
    fit = trials.fit(final)
    alternatives = [answer.rivals[key] if verdict != "unknown" else () for key in final.keys]
    left = remainders(problem, fit) if answer.more else ()
    correlation = correlation_of(problem, fit)
    findings = describe_findings(problem, fit, support, alternatives, correlation, classes)
    known = {c.name: c for c in classes}
    asked = next_experiment(verdict, findings, left, problem.floor, known, problem.silent)
    return Diagnosis(
        verdict=verdict,
        findings=findings,
        next_experiment=NOTHING_MOVES if nothing_moves else asked,
        error=ErrorLevel(
            before=float(np.sqrt(first.error)),
            after=float(np.sqrt(final.error)),
            floor=1.0,
            floor_source=problem.floor.source,
        ),
        outputs=_outputs(problem, fit, answer.level),
        explained=explained_share(first, final),
        steps=_steps(trials, final),
        remainder=describe(left),
        robot=fit.robot,
        warnings=tuple(warnings),
        ranking=with_covariances(rank_hypotheses(odds, final), trials),
        correlation=correlation,
        before=series_of(problem.robot, problem.records),
        after=series_of(fit.robot, problem.records),
        sources=tuple(log.source for log in logs),
        silent=problem.silent,
        band=problem.records[0].bandwidth.residual,
    )


def _answered(
    found: SearchResult, classes: Sequence[type[Effect]], ends: float
) -> tuple[Answer, SearchResult]:
    """Return the answer, made of what is known when the time ends or at Ctrl-C.

    Args:
        found: the search.
        classes: effects that may be used.
        ends: time [s] of the monotonic clock at which no more hypotheses are fitted.
    """
    trials, soon = found.trials, time.monotonic() + _LAST
    trials.until = inf  # the search is over
    trials.ends = soon if found.stopped == INTERRUPTED else max(ends, soon)
    try:
        return model_to_use(found, classes), found
    except KeyboardInterrupt:
        trials.ends = time.monotonic() + _LAST
        found = replace(found, stopped=INTERRUPTED)
        return model_to_use(found, classes), found


def about_silent(joints: Sequence[str], *, every: bool = False) -> list[str]:
    """Return one sentence about all the drives that report nothing of their load.

    Args:
        joints: of these drives.
        every: whether no other drive reports, so that they are judged all the same.
    """
    if joints and every:
        return [_ALL_SILENT.format(", ".join(joints))]
    text = _SILENT if len(joints) == 1 else _SEVERAL_SILENT
    return [text.format(", ".join(joints))] if joints else []


def _about_the_search(found: SearchResult) -> list[str]:
    """Return what a reader must know of a search that ended early or left effects out."""
    texts = []
    if found.stopped:
        texts.append(
            f"The search did not end by itself ({found.stopped}): this is the best answer so far."
        )
    for failure, count in found.trials.failures.items():
        trials = "one trial was" if count == 1 else f"{count} trials were"
        texts.append(f"{trials} left out of the search: {failure}")
    return texts


def _outputs(problem: EstimationProblem, fit: Fit, level: Attainable) -> tuple[OutputLevel, ...]:
    names, units = output_names(problem.robot), output_units(problem.robot)
    left = condensed_residual(fit.robot, problem.records)
    kept = [k for k in range(len(names)) if k not in problem.floor.aside]
    share = dict(zip(kept, np.sqrt(level.attainable / np.maximum(level.left, 1e-300)), strict=True))
    before, after = (np.sqrt(np.mean(r**2, axis=0)) for r in (problem.residual, left))
    floor, excess = problem.floor.values, problem.floor.excesses
    unknown = without_links(problem.robot)
    return tuple(
        OutputLevel(
            output=name,
            unit=units[k],
            before=float(before[k]),
            after=float(after[k]),
            attainable=float(max(after[k] * share.get(k, 1.0), min(after[k], floor[k]))),
            floor=float(floor[k]),
            judged=k in share,
            excess=float(excess[k]),
        )
        for k, name in enumerate(names)
        if k not in unknown
    )


def _steps(trials: Trials, final: Hypothesis) -> tuple[Step, ...]:
    """Return the staircase of the causes that stayed, in the order in which they act."""
    steps = [Step("", "", float(np.sqrt(trials.nothing.error)))]
    for count in range(1, len(final.effects) + 1):
        last = final.effects[count - 1]
        whole = count == len(final.effects)
        smaller = [final] if whole else trials.rivals_of(final, [final.effects[:count]])
        for h in smaller:
            steps.append(Step(last.name, last.where, float(np.sqrt(h.error))))
    return tuple(steps)
