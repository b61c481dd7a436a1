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
from wbc.identification.answer import diagnosis as told
from wbc.identification.answer.diagnosis import Diagnosis, Finding, Verdict
from wbc.identification.answer.findings import describe_findings
from wbc.identification.answer.model_to_use import Answer, model_to_use
from wbc.identification.answer.ranking import correlation_of, rank_hypotheses
from wbc.identification.answer.remainder import Remainder, common_trait, describe, remainders
from wbc.identification.answer.shown import series_of
from wbc.identification.answer.words import cut_short, not_following
from wbc.identification.choice import find_causes as search
from wbc.identification.choice.certainty import CERTAIN, EVEN, Support
from wbc.identification.choice.evidence import Hypothesis, Key
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import condensed_residual
from wbc.identification.readings.checks import without_copies
from wbc.identification.readings.first_guess import guessed_numbers
from wbc.identification.records.noise import NoiseFloor
from wbc.identification.records.not_judged import told_outputs
from wbc.identification.records.record import rms
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
    # A robot at rest shows one torque per joint, which anything explains. So does what is no torque
    # of the motion: on a recorded pendulum a soft gear that its other logs contradict was certain.
    wanted = EFFECTS.values() if candidates is None else candidates
    classes = () if _nothing_moves(problem) or _all_silent(problem) else tuple(wanted)
    until = begun + _SEARCH * budget
    found = search.find_causes(problem, classes, progress, until)
    try:
        if not found.stopped and (retimed := problem.retimed(robot, found.final.effects)):
            progress("searching again: beside what was found, the drives have other times")
            found = search.find_causes(retimed, classes, progress, until)
        found = search.look_closer(found, classes, progress)
        return _answered(found, logs, classes, warnings, begun + budget)
    except KeyboardInterrupt:
        found = replace(found, stopped=search.INTERRUPTED)
        return _answered(found, logs, classes, warnings, -inf)


def _answered(
    found: search.SearchResult,
    logs: Sequence[Log],
    classes: Sequence[type[Effect]],
    about_logs: Sequence[str],
    ends: float,
) -> Diagnosis:
    """Return the answer, made of what is known when the time ends or at Ctrl-C.

    Args:
        found: the search.
        logs: as they were given.
        classes: effects that may be used.
        about_logs: warnings.
        ends: time [s] of the monotonic clock at which no more hypotheses are fitted.
    """
    trials = found.trials
    trials.answering = True
    trials.until = -inf if found.stopped == search.INTERRUPTED else ends
    answer, problem, first = model_to_use(found, classes), trials.problem, trials.nothing
    final, fit = answer.hypothesis, trials.fit(answer.hypothesis)
    findings = describe_findings(trials, answer)
    support = answer.support | {f.effect.key: f.support for f in findings}
    verdict = verdict_of(problem, first, final, support, answer.more)
    left = remainders(problem, fit) if answer.more else ()
    doubtful = [key for key in final.keys if support[key].group_probability < EVEN]
    several = len({name for name, _ in doubtful}) > 1
    asked = NOTHING_MOVES
    if not _nothing_moves(problem):
        known = {c.name: c for c in classes}
        asked = next_experiment(verdict, findings, left, problem.floor, known, problem.silent)
    warnings = [
        *about_logs,
        *problem.warnings,
        *about_silent(problem.silent, every=_all_silent(problem)),
        *map(_STILL.format, problem.still),
        *_about_the_search(found),
    ]
    source = problem.robot.source
    if source and (guessed := ", ".join(guessed_numbers(source.name))):
        file = Path(source.name).name
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
        error=told.ErrorLevel(before, after, 1.0, problem.floor.source),
        outputs=_outputs(problem, fit.robot, answer),
        explained=explained_share(first, final),
        steps=_steps(trials, final),
        remainder=describe(left),
        robot=fit.robot,
        warnings=tuple(warnings),
        ranking=rank_hypotheses(trials, answer.odds, final),
        correlation=correlation_of(problem, fit),
        before=series_of(problem.robot, problem.records),
        after=series_of(fit.robot, problem.records),
        sources=tuple(log.source for log in logs),
        silent=problem.silent,
        band=problem.records[0].bandwidth.residual,
        trait=common_trait(problem, fit, doubtful) if several else "",
        stopped=found.stopped,
    )


def _nothing_moves(problem: EstimationProblem) -> bool:
    return len(problem.still) == problem.robot.transmission.size


def _all_silent(problem: EstimationProblem) -> bool:
    return bool(problem.silent) and set(problem.judged_joints) <= set(problem.silent)


def about_silent(joints: Sequence[str], *, every: bool = False) -> list[str]:
    """Return one sentence about all the drives that report nothing of their load.

    Args:
        joints: of these drives.
        every: whether no other drive reports, so that they are judged all the same.
    """
    so = "no drive reports more, so no cause is looked for" if every else "it is set aside"
    return [_SILENT.format(", ".join(joints), so)] if joints else []


def _about_the_search(found: search.SearchResult) -> list[str]:
    """Return what a reader must know of a search that ended early or left effects out."""
    texts = []
    if found.stopped:
        texts.append(cut_short(found.stopped))
    for failure, count in found.trials.failures.items():
        trials = "one trial was" if count == 1 else f"{count} trials were"
        texts.append(f"{trials} left out of the search: {failure}")
    return texts


def _outputs(
    problem: EstimationProblem, robot: Robot, answer: Answer
) -> tuple[told.OutputLevel, ...]:
    level, floor, judged = answer.level, problem.floor, problem.floor.judged
    before, after = rms(problem.residual), rms(condensed_residual(robot, problem.records))
    reached, kept = np.ones_like(after), np.isin(np.arange(after.size), judged)
    reached[judged] = np.sqrt(level.attainable / np.maximum(level.left, 1e-300))
    reached = np.maximum(after * reached, np.minimum(after, floor.values))
    columns = before, after, reached, floor.values, kept, floor.excesses
    rows = list(zip(*(column.tolist() for column in columns), strict=True))
    told_of = told_outputs(problem.records)
    return tuple(told.OutputLevel(name, unit, *rows[k]) for k, name, unit in told_of)


def _steps(trials: Trials, final: Hypothesis) -> tuple[told.Step, ...]:
    """Return the staircase of the causes that stayed, in the order in which they act.

    An effect at several places that follow one another is one step.
    """
    steps, count = [told.Step("", "", float(np.sqrt(trials.nothing.error)))], 0
    for name, several in groupby(final.effects, key=lambda effect: effect.name):
        places = [effect.where for effect in several]
        count += len(places)
        whole = count == len(final.effects)
        smaller = [final] if whole else trials.rivals_of(final, [final.effects[:count]])
        where = joined(places) if len(places) <= FEW else f"{len(places)} places"
        steps += [told.Step(name, where, float(np.sqrt(h.error))) for h in smaller]
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
        # Whether the causes found explain a substantial part of what was missing at some output.
        before = np.maximum(first.outputs - 1.0, 1e-300)
        share = 1.0 - np.maximum(final.outputs - 1.0, 0.0) / before
        substantial = np.any((share > _SUBSTANTIAL) & (before > 1.0))
        return "partial" if certain and substantial else "unknown"
    if not support:
        return "none" if problem.floor.excesses.max() < _DISAGREEMENT else "not_repeatable"
    likely = {key: s for key, s in support.items() if s.likely}
    if not likely:
        # What drives that are late by times of their own do as well may be nothing else.
        late = all(s.belief >= EVEN for s in support.values())
        return "none" if late else "unknown"
    certain = any(s.group_probability >= CERTAIN for s in likely.values())
    open_names = {name for (name, _), s in likely.items() if s.group_probability < CERTAIN}
    if certain and len(open_names) > 1:
        return "partial"
    tied = any(s.group > s.odds for s in likely.values())
    return "named" if certain and not tied else "ambiguous"


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
        return _to_learn_more(left, floor, silent)
    texts = _to_tell_apart(findings, classes)
    return " ".join(texts or dict.fromkeys(finding.effect.experiment for finding in findings))


def _to_learn_more(left: Sequence[Remainder], floor: NoiseFloor, silent: Sequence[str]) -> str:
    """Return what to do about drives that report no torque of the motion, and what is left."""
    texts = []
    if silent:
        it, joints = ("it", "this joint") if len(silent) == 1 else ("them", "these joints")
        texts.append(
            f"{not_following(silent)}, so these logs say nothing about {joints}. Move {it} faster "
            "or with a known weight. If the torque still does not follow, correct its column, its "
            f"unit or the torque constant, or look for what acts on {it} and is not in the model."
        )
    other = sorted((one for one in left if one.output not in silent), key=lambda one: -one.floors)
    if other or not silent:
        asked = list(dict.fromkeys(one.experiment for one in other if one.experiment))[:_ASKED]
        texts += [f"{text[:1].upper()}{text[1:]}." for text in asked]
        if not floor.repeats:
            texts.append("Repeat one run exactly: that shows how much of what is left is noise.")
        if not asked:
            texts.append("Move one joint at a time, slowly and fast, through the same positions.")
    return " ".join(texts)


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
