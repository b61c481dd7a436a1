"""From logs to an answer: prepare, search, judge, say what to record next."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby, permutations
from math import inf
from pathlib import Path

import numpy as np

from wbc.effects import EFFECTS
from wbc.identification.answer.diagnosis import (
    Diagnosis,
    ErrorLevel,
    Finding,
    OutputLevel,
    Step,
    Verdict,
    correlation_of,
    rank_hypotheses,
)
from wbc.identification.answer.findings import describe_findings
from wbc.identification.answer.model_to_use import Answer, model_to_use
from wbc.identification.answer.remainder import (
    Attainable,
    Remainder,
    common_trait,
    describe,
    remainders,
)
from wbc.identification.answer.shown import series_of
from wbc.identification.answer.words import not_following
from wbc.identification.choice.certainty import CERTAIN, EVEN, Support
from wbc.identification.choice.evidence import Hypothesis, Key
from wbc.identification.choice.find_causes import (
    INTERRUPTED,
    SearchResult,
    find_causes,
    look_closer,
)
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import condensed_residual
from wbc.identification.readings.checks import without_copies
from wbc.identification.readings.first_guess import guessed_numbers
from wbc.identification.records.noise import NoiseFloor
from wbc.identification.records.not_judged import without_links
from wbc.identification.records.record import output_names, output_units
from wbc.measurement import Log
from wbc.robot import Effect, Robot
from wbc.tables import FEW, joined

_SEARCH = 0.8  # of the time that is given
_STILL = (
    "{} does not move in these logs: they say nothing about its friction, inertia or gears. Record "
    "it moving back and forth, slowly and fast."
)
_SILENT = (
    "{}: the torque reported there does not follow what the motion needs; {}. Either too little "
    "was carried in these logs, something acts there that is not in the model, or a torque "
    "constant, unit, column or clock is wrong."
)
# Share of the mean square error of one output that is no small part: 0.25 to 0.9 give the same
# verdicts on 60 generated logs in which something stays unexplained.
_SUBSTANTIAL = 0.5
_ASKED = 2  # experiments for what is left, the worst output first
_DISAGREEMENT = 4.0  # repeated runs differ by so many times what their sensors' noise explains


def diagnose(
    robot: Robot,
    logs: Sequence[Log],
    candidates: Sequence[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda line: None,
    budget: float = inf,
) -> Diagnosis:
    """Return which physical effects `robot` lacks, according to `logs`.

    When its time is over, or at Ctrl-C, the answer is the best so far, and a warning says so: it
    is made of what is known then. An effect that raises an
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
    still = problem.still
    nothing_moves = len(still) == robot.transmission.size
    all_silent = bool(problem.silent) and set(problem.judged_joints) <= set(problem.silent)
    # A robot at rest shows one torque per joint, which anything explains. So does what is no torque
    # of the motion: on a recorded pendulum a soft gear that its other logs contradict was certain.
    wanted = EFFECTS.values() if candidates is None else candidates
    classes = () if nothing_moves or all_silent else tuple(wanted)
    until = begun + _SEARCH * budget
    found = find_causes(problem, classes, progress, until)
    if not found.stopped and (retimed := problem.retimed(robot, found.final.effects)):
        progress("searching again: beside what was found, the drives have other times")
        found = find_causes(retimed, classes, progress, until)
    found = look_closer(found, classes, progress)
    answer, found = _answered(found, classes, begun + budget)
    trials = found.trials
    problem, first = trials.problem, trials.nothing
    warnings += [
        *problem.warnings,
        *about_silent(problem.silent, every=all_silent),
        *map(_STILL.format, still),
        *_about_the_search(found),
    ]
    final, odds, support = answer.hypothesis, answer.odds, answer.support
    verdict = verdict_of(problem, first, final, support, answer.more)
    fit = trials.fit(final)
    left = remainders(problem, fit) if answer.more else ()
    findings = describe_findings(trials, answer)
    doubtful = [key for key in final.keys if support[key].group_probability < EVEN]
    several = len({name for name, _ in doubtful}) > 1
    known = {c.name: c for c in classes}
    asked = next_experiment(verdict, findings, left, problem.floor, known, problem.silent)
    asked = NOTHING_MOVES if nothing_moves else asked
    if robot.source and (guessed := ", ".join(guessed_numbers(robot.source.name))):
        file = Path(robot.source.name).name
        look_up = f"Look up {guessed} in {file}: every answer rests on these guesses."
        # What to do now is told for every verdict, but for these two it is not the experiment.
        if verdict in ("named", "none"):
            warnings.insert(0, look_up)
        else:
            asked = f"{look_up} {asked}"
    before, after = np.sqrt([first.error, final.error]).tolist()
    return Diagnosis(
        verdict=verdict,
        findings=findings,
        next_experiment=asked,
        error=ErrorLevel(before, after, 1.0, problem.floor.source),
        outputs=_outputs(problem, fit, answer.level),
        explained=explained_share(first, final),
        steps=_steps(trials, final),
        remainder=describe(left),
        robot=fit.robot,
        warnings=tuple(warnings),
        ranking=rank_hypotheses(trials, odds, final),
        correlation=correlation_of(problem, fit),
        before=series_of(problem.robot, problem.records),
        after=series_of(fit.robot, problem.records),
        sources=tuple(log.source for log in logs),
        silent=problem.silent,
        band=problem.records[0].bandwidth.residual,
        trait=common_trait(problem, fit, doubtful) if several else "",
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
    trials = found.trials
    trials.answering = True
    trials.until = -inf if found.stopped == INTERRUPTED else ends
    try:
        return model_to_use(found, classes), found
    except KeyboardInterrupt:
        trials.until = -inf
        found = replace(found, stopped=INTERRUPTED)
        return model_to_use(found, classes), found


def about_silent(joints: Sequence[str], *, every: bool = False) -> list[str]:
    """Return one sentence about all the drives that report nothing of their load.

    Args:
        joints: of these drives.
        every: whether no other drive reports, so that they are judged all the same.
    """
    so = "no drive reports more, so no cause is looked for" if every else "it is set aside"
    return [_SILENT.format(", ".join(joints), so)] if joints else []


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
    kept = problem.floor.judged.tolist()
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
    """Return the staircase of the causes that stayed, in the order in which they act.

    An effect at several places that follow one another is one step.
    """
    steps, count = [Step("", "", float(np.sqrt(trials.nothing.error)))], 0
    for name, several in groupby(final.effects, key=lambda effect: effect.name):
        places = [effect.where for effect in several]
        count += len(places)
        whole = count == len(final.effects)
        smaller = [final] if whole else trials.rivals_of(final, [final.effects[:count]])
        where = joined(places) if len(places) <= FEW else f"{len(places)} places"
        steps += [Step(name, where, float(np.sqrt(h.error))) for h in smaller]
    return tuple(steps)


def verdict_of(
    problem: EstimationProblem,
    first: Hypothesis,
    final: Hypothesis,
    support: Mapping[Key, Support],
    more: bool,
) -> Verdict:
    """Return the verdict.

    Several names that are likely and not certain, beside a certain one, are a sign of a cause that
    is not in the list: each takes a part of it.

    Args:
        problem: the logs.
        first: the robot as given.
        final: what was found.
        support: of its causes, and of what is named beside it.
        more: whether something is left that nothing found explains.
    """
    if more:
        certain = any(s.group_probability >= CERTAIN for s in support.values())
        return "partial" if certain and _substantial(first, final) else "unknown"
    if not support:
        return "none" if problem.floor.excesses.max() < _DISAGREEMENT else "not_repeatable"
    likely = [s for s in support.values() if s.group_probability >= EVEN]
    if not likely:
        # What drives that are late by times of their own do as well may be nothing else.
        late = all(s.belief >= EVEN for s in support.values())
        return "none" if late else "unknown"
    certain = any(s.group_probability >= CERTAIN for s in likely)
    open_names = {name for (name, _), s in support.items() if EVEN <= s.group_probability < CERTAIN}
    if certain and len(open_names) > 1:
        return "partial"
    return "named" if certain and not any(s.group > s.odds for s in likely) else "ambiguous"


def _substantial(first: Hypothesis, final: Hypothesis) -> bool:
    """Whether the causes found explain a substantial part of what was missing at some output."""
    before = np.maximum(first.outputs - 1.0, 1e-300)
    share = 1.0 - np.maximum(final.outputs - 1.0, 0.0) / before
    return bool(np.any((share > _SUBSTANTIAL) & (before > 1.0)))


def explained_share(first: Hypothesis, final: Hypothesis) -> float:
    """Return the share of the mean square error above the floor that was taken away."""
    before = max(first.error - 1.0, 1e-300)
    return float(np.clip(1.0 - max(final.error - 1.0, 0.0) / before, 0.0, 1.0))


NOTHING_MOVES = (
    "Nothing moves in these logs, and at rest every effect looks like another. Move each "
    "joint back and forth through its range, slowly and fast, loaded and unloaded."
)
"""What to record next where no joint moves."""


def next_experiment(
    verdict: Verdict,
    findings: Sequence[Finding],
    left: Sequence[Remainder],
    floor: NoiseFloor,
    classes: Mapping[str, type[Effect]],
    silent: Sequence[str] = (),
) -> str:
    """Return what to record next, in words.

    Args:
        verdict: of the diagnosis.
        findings: the effects found.
        left: what they leave.
        floor: the noise floor.
        classes: the candidates by name.
        silent: joints whose drives report no torque of the motion.
    """
    if verdict == "none":
        return "Nothing is missing on these logs; record faster or loaded motions to look further."
    if verdict == "not_repeatable":
        return (
            "Runs that should repeat one another do not: check what changed between them "
            "(temperature, mounting, payload, supply) and record one motion several times."
        )
    if verdict in ("unknown", "partial"):
        other = [one for one in left if one.output not in silent]
        known = [_of_what_is_left(other, floor)] if other or not silent else []
        return " ".join([*_of_silent(silent), *known])
    texts = _to_tell_apart(findings, classes)
    return " ".join(texts or dict.fromkeys(finding.effect.experiment for finding in findings))


def _to_tell_apart(findings: Sequence[Finding], classes: Mapping[str, type[Effect]]) -> list[str]:
    """Return the motions that tell rivals apart, each once, and what no motion tells."""
    places: dict[tuple[str, ...], dict[str, None]] = {}
    impossible: dict[str, None] = {}
    for finding in findings:
        if not finding.alternatives:
            continue
        rivals = [classes[a.effect] for a in finding.alternatives if a.effect in classes]
        kinds = list(dict.fromkeys([type(finding.effect), *rivals]))
        motions = dict.fromkeys(_motion(kind) for kind in kinds)
        places.setdefault(tuple(motions)[:FEW], {})[finding.effect.where] = None
        for one, other in permutations(kinds, 2):
            if other.name in one.search.inseparable:
                impossible[one.search.inseparable[other.name]] = None
    if not places:
        return []
    asked = [f"At {joined(list(at))}: {'; '.join(motions)}." for motions, at in places.items()]
    return ["Record more motions.", *asked, *impossible]


def _motion(kind: type[Effect]) -> str:
    """Return the motion that shows an effect, without what it shows: the logs will tell that."""
    motion = kind.experiment.partition(": ")[0].rstrip(".")
    return motion[:1].lower() + motion[1:]


def _of_silent(silent: Sequence[str]) -> list[str]:
    """Return what to do about drives that report no torque of the motion."""
    if not silent:
        return []
    it, joints = ("it", "this joint") if len(silent) == 1 else ("them", "these joints")
    return [
        f"{not_following(silent)}, so these logs say nothing about {joints}. Move {it} faster or "
        "with a known weight. If the torque still does not follow, correct its column, its unit or "
        f"the torque constant, or look for what acts on {it} and is not in the model."
    ]


def _of_what_is_left(left: Sequence[Remainder], floor: NoiseFloor) -> str:
    worst = sorted(left, key=lambda one: -one.floors)
    asked = list(dict.fromkeys(one.experiment for one in worst if one.experiment))[:_ASKED]
    texts = [f"{text[:1].upper()}{text[1:]}." for text in asked]
    if not floor.repeats:
        texts.append("Repeat one run exactly: that shows how much of what is left is noise.")
    if not asked:
        texts.append("Move one joint at a time, slowly and fast, through the same positions.")
    return " ".join(texts)
