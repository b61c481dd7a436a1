"""The mistakes in columns of logs: what contradicts itself, and what the torques say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from wbc.errors import LogError
from wbc.identification.readings import evidence
from wbc.identification.readings.evidence import Judged
from wbc.identification.readings.kinds import LINKS, readings
from wbc.identification.readings.log_rows import rows_of
from wbc.measurement import column_mistakes
from wbc.measurement.checks import find_repeats, resting_joints
from wbc.measurement.column_map import say_so, together
from wbc.measurement.log import CERTAIN, LIKELY, Log, LogFinding, severity
from wbc.measurement.read import mended
from wbc.robot import Robot
from wbc.tables import few

_SCALE = "Check gear_ratio and torque constant in robot.toml and the masses of the model."
_FOREIGN = "Check which joint the column is of, what it holds, and whether this is the right model."
_MORE = "Record more logs in which every joint moves, and give all of them together."


class SuspiciousLogError(LogError):
    """Columns of logs hold something else than their names say.

    Attributes:
        findings: the suspicions, those that are certain first.
    """

    def __init__(self, message: str, findings: Sequence[LogFinding]) -> None:
        """Keep the findings beside the message."""
        super().__init__(message)
        self.findings = tuple(findings)


def find_suspicions(logs: Sequence[Log], robot: Robot | None = None) -> list[list[LogFinding]]:
    """Return for every log what is suspected of its columns, gravest first.

    Args:
        logs: of one robot.
        robot: whose they are; without it only contradictions inside a log show.

    Returns:
        Findings of the severity `error` where the mistake is certain (probability 0.99), unless
        the column map says that the columns are trusted, and of `warning` where it is likely.
    """
    ratios = single_ratios(robot) if robot is not None else {}
    found: list[list[LogFinding]] = [[] for _ in logs]
    clean = list(logs)

    def add(each: Sequence[Sequence[LogFinding]]) -> None:
        """Keep what logs show, and go on with logs in which it is mended where it is certain."""
        for k, own in enumerate(each):
            found[k] += own
            certain = [f.mend for f in own if f.probability >= CERTAIN]
            clean[k] = mended(clean[k], together(certain))

    add([column_mistakes.stale_rows(log) for log in clean])
    add([column_mistakes.wraps(log) for log in clean])
    add(column_mistakes.motion_findings(clean, ratios))
    refused = column_mistakes.magnitudes(logs)
    add([refused for _ in logs])
    counted = [_counts(log) for log in clean]
    if robot is not None and not refused:
        told = torque_mistakes(robot, clean)
        if any(finding.kind == "counts" for finding, _ in told):
            counted = [[] for _ in logs]  # the torque says how many counts make a turn
        for finding, having in told if not any(counted) else ():
            for k in having:
                found[k].append(finding)
    add(counted)
    for k, log in enumerate(logs):
        if log.source.trusted:  # the user vouches for the columns
            found[k] = [replace(finding, severity="warning") for finding in found[k]]
    return found


def _counts(log: Log) -> list[LogFinding]:
    """Return what to do about positions that hold encoder counts, of which nothing says more."""
    held = column_mistakes.whole_counts(log)
    worth = column_mistakes.COUNTS_OF_A_TURN[4096]
    way = say_so({"columns": {name: {"scale": worth} for name in held}})
    way = f"Of an encoder of 4096 counts a turn, {way}\nOf another, put 2 pi over its counts there."
    text = "whole numbers far beyond turns: encoder counts."
    return [LogFinding("error", "counts", ", ".join(held), text, way)] if held else []


def suspicions(robot: Robot, logs: Sequence[Log]) -> list[str]:
    """Return a sentence for each mistake that is likely; raise where one is certain.

    Args:
        robot: the robot that the user believes in.
        logs: of it.

    Raises:
        SuspiciousLogError: a column holds something else than it says. The message says which, and
            what a column map must say; that the columns are trusted, if they are right. Or no joint
            moves in any of the logs.
    """
    still = motionless(robot, logs)
    if still is not None:
        raise SuspiciousLogError(f"{still.text} {still.way_out}", [still])
    found: dict[str, tuple[LogFinding, list[str]]] = {}
    for log, own in zip(logs, find_suspicions(logs, robot), strict=True):
        for finding in own:
            found.setdefault(finding.text, (finding, []))[1].append(log.source.label)

    def whose(labels: Sequence[str]) -> str:
        return "" if len(labels) == len(logs) else f"{few(labels)}: "

    said = {text: whose(labels) + text for text, (_, labels) in found.items()}
    certain = [finding for finding, _ in found.values() if finding.severity == "error"]
    if certain:
        mend = together(finding.mend for finding in certain)
        message = " ".join(said[finding.text] for finding in certain)
        way = f" {certain[0].way_out}" if not mend else " If so, " + say_so(mend)
        raise SuspiciousLogError(
            f"{message}{way}\nIf the columns are right, " + say_so({"trusted": True}), certain
        )
    return [f"{said[text]} {finding.way_out}" for text, (finding, _) in found.items()]


def motionless(robot: Robot, logs: Sequence[Log]) -> LogFinding | None:
    """Return what to do about logs without motion, None where there is some.

    A log whose every channel is constant is no measurement. Where joints only flicker by the noise
    of their sensors, they must at least stand elsewhere in another log.
    """
    way = "Record the robot in motion; if it moved, the columns are not connected."
    joints = {*robot.single_joints}
    moves = any(joints & {*log.with_quantity("position")} - resting_joints(log) for log in logs)
    names = [f"{joint}.position" for joint in joints]
    held = [own for n in names if (own := [log.column(n) for log in logs if log.has(n)])]
    for places in held:
        moves |= bool(np.ptp([p.mean() for p in places]) > 3.0 * max(map(np.ptp, places)))
    if held and not moves:
        which = "this log" if len(logs) == 1 else "these logs"
        text = f"no joint moves in {which}: every position is constant, but for noise."
        return LogFinding("error", "constant_log", "", f"{logs[0].source.label}: {text}", way)
    dead = [log for log in logs if log.columns and not any(map(np.ptp, log.columns.values()))]
    text = ", ".join(log.source.label for log in dead)
    text += ": every channel is constant, and no joint moves in this log."
    return LogFinding("error", "constant_log", "", text, f"Leave it out. {way}") if dead else None


def single_ratios(robot: Robot) -> dict[str, float]:
    """Return N of the joints that one motor drives alone (row and column of D are the identity)."""
    gears = robot.transmission
    odd = np.abs(gears.topology - np.eye(gears.size)) > 0.0
    alone = np.flatnonzero(~(odd.any(axis=0) | odd.any(axis=1)))
    return {gears.joints[k]: float(gears.gear_ratio[k]) for k in alone}


# Probability of any mistake from which logs leave open whether they are right. Of ten right logs of
# 5 to 10 s (seven of a recorded double pendulum, three of the sample leg) none is above 0.04.
_POSSIBLE = 0.5
# Share of a report's power left, from which it may be another joint's where there are many joints,
# and from which gravity and zeros are asked about. Of 2114 true reports of generated robots with
# hidden causes 2 % leave more than 0.13, 8 % more than 0.015; exchanged wrists leave less.
_RARELY_LEFT, _DOUBTFUL = 0.13, 0.015
_TIED = 2.0  # nats: odds of seven to one
_PAIRS = 7  # driven joints up to which any may be exchanged: half a second per log
# Share of the power of a report that a reading must explain to accuse anybody: with counts for
# radians degrees explain .01 "better" than nothing; the true readings of the tests .46 and more.
_LEAST_EXPLAINED = 0.25
_OTHER_RATIO = float(np.log(0.02))  # as often as another unit of all columns
_SAME_RATIO = 0.1  # of ln of the factor, below which nobody would call it another gear
_LINKS_WRONG = float(np.log(0.15))  # every joint has its own factor: in two of 13 recorded machines
_MOST = 3  # mistakes that are looked for one after another


def torque_mistakes(robot: Robot, logs: Sequence[Log]) -> list[tuple[LogFinding, tuple[int, ...]]]:
    """Return the mistakes in the columns of logs, one after another, each on mended logs.

    With each come the numbers of the logs that have it.

    Args:
        robot: the robot that the user believes in.
        logs: of it; those that cannot be held against it are passed over.
    """
    found: list[tuple[LogFinding, tuple[int, ...]]] = []
    current = list(logs)
    while len(found) < _MOST:
        numbers, judged = _judged(robot, current)
        if not judged:
            return found
        likeliest = _likeliest(robot, judged)
        if likeliest is None:
            # Lags of torques that explain too little to be certain.
            late = [one for one in judged if one.reading.kind == "torque_late"]
            more = [_told(robot, [one], judged[0], one.logs, _POSSIBLE) for one in late]
            more = more or _foreign(robot, judged) or _other_scale(robot, judged[0])
            return found or [(finding, numbers) for finding in more]
        mistake, own = likeliest
        having = tuple(numbers[k] for k in own)
        found.append((mistake, having))
        if mistake.probability < CERTAIN or not mistake.mend:
            return found
        for k in having:
            current[k] = mended(current[k], mistake.mend)
    return found


def _judged(robot: Robot, logs: Sequence[Log]) -> tuple[tuple[int, ...], list[Judged]]:
    """Return the numbers of logs that can be held against a robot, and every reading of them.

    The first is that they are right.
    """
    each = {k: rows_of(robot, log) for k, log in enumerate(logs)}
    known = {k: rows for k, rows in each.items() if rows is not None}
    if not known:
        return (), []
    alike, rows = {k: len(group) for group in find_repeats(logs) for k in group}, [*known.values()]
    bench = evidence.Bench(rows, [1.0 / alike.get(k, 1) for k in known])
    lags = evidence.shared_lags(rows, max(logs[k].sample_time for k in known))
    # A mistake of all logs must be read in all of them: what one log shows is asked of the others.
    most = np.max([[one.left for one in reports] for reports in bench.as_is.reports], axis=0)
    lost = most > (0.0 if robot.transmission.size <= _PAIRS else _RARELY_LEFT)
    doubtful = bool(np.any(most > _DOUBTFUL))
    others = readings(rows[0], lost, doubtful, lags, evidence.turns(rows) if doubtful else [])
    return tuple(known), [bench.as_is, *map(bench.judged, others)]


def _likeliest(robot: Robot, judged: Sequence[Judged]) -> tuple[LogFinding, tuple[int, ...]] | None:
    """Return the likeliest mistake of all logs, or of those that are better read with it alone."""
    (as_is, *others), every = judged, judged[0].logs
    stands, few = as_is.weight(as_is, every), -float(np.log(len(every)))
    scores: list[tuple[float, Judged, tuple[int, ...]]] = []
    for one in others:
        if one.logs == every:
            scores.append((one.score(as_is, every), one, every))
        # No robot is another one in a single log.
        several = one.logs if len(every) > 1 and one.reading.kind != LINKS else ()
        own = tuple(k for k in several if one.score(as_is, (k,)) + few > stands)
        if own and own != every:
            scores.append((one.score(as_is, own) + few, one, own))
    columns = logsumexp([score for score, one, _ in scores if one.reading.kind != LINKS])
    wrong = logsumexp([score for score, *_ in scores])
    other, none, factor = evidence.ratio_evidence(as_is.reports)
    other += _OTHER_RATIO if np.all(robot.transmission.reflected_inertia > 0.0) else -np.inf
    whole = logsumexp([stands, wrong, other])
    doubt = float(np.exp(other - np.logaddexp(whole, none + as_is.reading.prior)))
    if doubt >= LIKELY and abs(np.log(factor)) >= _SAME_RATIO:
        return _another_ratio(robot, doubt, factor), every
    doubt = float(np.exp(columns - whole))
    scores.sort(key=lambda scored: (scored[1].reading.kind == LINKS, -scored[0]))
    best, first, logs = scores[0]
    now, then = first.explained(as_is, logs)
    least = _LEAST_EXPLAINED if doubt >= LIKELY else 1.0 - _RARELY_LEFT
    # Links that need the same torque leave open which is true.
    both = logs == every and max(score for score, *_ in scores) - best < _TIED
    shown = float(np.exp((wrong if both else columns) - whole))
    if shown < (_POSSIBLE if logs == every else LIKELY) or then[np.argmax(then - now)] < least:
        return None
    tied = [one for score, one, own in scores if best - score < _TIED and own == logs]
    return _told(robot, tied[:4], as_is, logs, doubt), logs


def told_by_rows(robot: Robot, logs: Sequence[Log]) -> dict[str, tuple[float, float]]:
    """Return how well the rows tell the columns of each driven joint from those of the others.

    Args:
        robot: whose logs they are.
        logs: of it.

    Returns:
        Joint -> (probability that its position and torque are its own, with even odds for every
        exchange with another joint; share of its torque's power that the motion explains). Empty
        where the logs cannot be held against the robot, or nothing can be exchanged.
    """
    _, judged = _judged(robot, logs)
    odds = np.zeros(robot.transmission.size)
    if not judged or odds.size < 2:
        return {}
    as_is, *others = judged
    stands = as_is.weight(as_is, as_is.logs) - as_is.reading.prior
    for one in others:
        if own := one.reading.exchanged:
            gained = one.score(as_is, one.logs) - one.reading.prior - stands
            odds[[*own]] += np.exp(min(gained, 500.0))
    shares = as_is.explained(as_is, as_is.logs)[0]
    told = zip((1.0 / (1.0 + odds)).tolist(), shares.tolist(), strict=True)
    return dict(zip(robot.transmission.joints, told, strict=True))


def _other_scale(robot: Robot, as_is: Judged) -> list[LogFinding]:
    """Return the torques that are as many times too large in all joints, or in one alone.

    A gear ratio, a torque constant and masses make the same factor; only a remark comes of it. So
    do causes that a robot is known to have, such as losses of its gears.
    """
    if robot.transmission.size < 2 or robot.effects:
        return []
    total, _ = evidence.at_gains(as_is.reports)
    alike = logsumexp(evidence.SAME_GAIN + total, axis=1)
    names, every = robot.transmission.joints, np.arange(len(total))
    own = logsumexp(evidence.GAIN_PRIOR + total, axis=1) - alike
    whole = float(logsumexp(evidence.GAIN_PRIOR + total.sum(axis=0)) - alike.sum())
    rivals = [every, *every[:, None]]
    odds = _OTHER_RATIO + np.array([whole, *own])
    best = int(np.argmax(odds))
    if odds[best] < logsumexp([0.0, _LINKS_WRONG + float(own.sum()), *np.delete(odds, best)]):
        return []
    joints = rivals[best]
    factor = evidence.GAINS[int(np.argmax(evidence.GAIN_PRIOR + total[joints].sum(axis=0)))]
    which = ", ".join(names[k] for k in joints)
    text = f"torques of {which} are {factor:.2g} times what the links need."
    return [LogFinding("warning", "torque_scale", "", text, _SCALE, {}, 0.5)]


def _foreign(robot: Robot, judged: Sequence[Judged]) -> list[LogFinding]:
    """Return the reports of which nobody understands what they follow, in all logs.

    Nothing can be approved then: of nineteen right machines no report is above .77 (a wrist of the
    KUKA, whose motor feels next to nothing); noise in place of a torque has .985 and more. Where
    friction is all that a report shows, other readings explain it without the links: then the logs
    leave open which is true.
    """
    as_is, *others = judged
    doubts, found = evidence.foreign(as_is.reports), []
    left = np.array([[min(one.left, 1.0) for one in reports] for reports in as_is.reports])
    for k in np.flatnonzero((doubts >= LIKELY) & np.any(left >= _RARELY_LEFT, axis=0)):
        read = [one for one in others if one.logs == as_is.logs]
        read = [one for one in read if all(r[k].left < _RARELY_LEFT for r in one.reports)]
        odds = [one.weight(as_is, as_is.logs) for one in read]
        if read:
            near = [read[n] for n in np.argsort(odds)[::-1] if max(odds) - odds[n] < _TIED]
            found.append(_told(robot, near, as_is, as_is.logs, _POSSIBLE))
            continue
        joint, doubt = robot.transmission.joints[k], float(doubts[k])
        text = f"the torque of {joint} does not follow what the links need: however the columns "
        text += f"are read, {100.0 * left[:, k].mean():.0f} % of its power has no explanation."
        found.append(LogFinding("error", "torque_foreign", joint, text, _FOREIGN, {}, doubt))
    return found


def _another_ratio(robot: Robot, doubt: float, factor: float) -> LogFinding:
    """Return that the robot's gear ratios are others."""
    ratios = ", ".join(f"{factor * N:.3g}" for N in robot.transmission.gear_ratio)
    text = f"the gear ratios of the robot are {factor:.2f} times those that the description states "
    text += f"({ratios}; the torque and the inertia of the rotors agree on it)?"
    way = "Check gear_ratio in robot.toml, and whether the logs are of this robot."
    return LogFinding(severity(doubt), "gear_ratio", "", text, way, {}, doubt)


def _told(
    robot: Robot, told: Sequence[Judged], as_is: Judged, logs: Sequence[int], doubt: float
) -> LogFinding:
    """Return what may be wrong, whether the logs can tell it, and what to do.

    Args:
        robot: whose logs they are.
        told: readings that the logs cannot tell apart, the likeliest first.
        as_is: the logs as they stand.
        logs: numbers of those that have the mistake.
        doubt: probability of any of them.
    """
    read, alone = [one.reading for one in told], len(logs) < len(as_is.reports)
    who, rivals = "one log" if len(logs) == 1 else "these logs", ", or ".join(r.text for r in read)
    said, if_so = f"{rivals}?", "If the first is true" if len(read) > 1 else "So read"
    if doubt < LIKELY:
        said = f"{who} cannot tell whether the columns are right: perhaps {rivals}."
    elif len(read) > 1:
        said += f" {who[0].upper()}{who[1:]} cannot tell which."
    ways = {one.text: one.way or say_so(one.mend) for one in read}
    way = "If so, " + ways[read[0].text]
    if len(read) > 1 or doubt < LIKELY:
        way = "\n".join((_MORE, *(f"If you know that {text}, {so}" for text, so in ways.items())))
    if alone:
        way = "Give each of these logs a map of its own, LOG@MAP.toml. " + way
    now, then = told[0].explained(as_is, logs)
    k = int(np.argmax(then - now))
    said += f" {if_so}, the robot explains {100.0 * then[k]:.0f} % of the power of the torque of "
    said += f"{robot.transmission.joints[k]}, and {100.0 * now[k]:.0f} % as it stands."
    likeliest, kind = {} if read[0].way else read[0].mend, read[0].kind
    column, mend = next(iter(likeliest.get("columns", [""]))), likeliest if len(read) == 1 else {}
    return LogFinding(severity(doubt), kind, column, said, way, mend, doubt, likeliest, alone)
