"""The mistakes in columns of logs: what contradicts itself, and what the torques say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.measurement.channel_checks import resting_joints
from wbc.measurement.clocks import find_repeats
from wbc.measurement.column_mistakes import (
    MotionMistake,
    counts,
    magnitudes,
    motion_mistakes,
    slow_clock,
    stale_rows,
    together_likely,
    wraps,
)
from wbc.measurement.evidence import GAIN_SPREAD, Report, common_lag, evidence, ratio_evidence
from wbc.measurement.findings import LogFinding, Mend, say_so, together
from wbc.measurement.log import Log
from wbc.measurement.log_rows import rows_of
from wbc.measurement.read import mended
from wbc.measurement.readings import Bench, Reading, as_it_stands, listed, readings
from wbc.robot import Robot

_TRUST = {"trusted": True}
_GRAVITY = {
    "no_gravity": "record the whole torque (an option of the driver). For torques that never held "
    "gravity, robot.toml must hold none, at its top:\n"
    '    gravity = { value = [0, 0, 0], unit = "m/s^2", source = "the driver takes it out" }',
    "upside_down": "robot.toml must say so, at its top:\n"
    '    gravity = { value = [0, 0, 9.81], unit = "m/s^2", source = "hangs upside down" }',
}
_SCALE = (
    "Check gear_ratio and torque constant in robot.toml and the masses of the model: each can make "
    "such a factor."
)
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
    found = [[*stale_rows(log), *wraps(log)] for log in logs]
    clean = [_mended(log, own) for log, own in zip(logs, found, strict=True)]
    for own, moved in zip(found, _shared([_of_motion(log, ratios) for log in clean]), strict=True):
        own += moved
    refused = magnitudes(logs)
    counted = [counts(log) for log in clean]
    for own, more in zip(found, counted, strict=True):
        own += [*refused, *more]
    if robot is not None and not refused and not any(counted):
        clean = [_mended(log, own) for log, own in zip(logs, found, strict=True)]
        for mistake in torque_mistakes(robot, clean):
            for k in mistake.logs:
                found[k].append(_of_torque(mistake, logs))
    return [[_trusted(f, log) for f in own] for log, own in zip(logs, found, strict=True)]


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
    each = find_suspicions(logs, robot)
    found: dict[str, LogFinding] = {}
    where: dict[str, list[str]] = {}
    for log, own in zip(logs, each, strict=True):
        for finding in own:
            found.setdefault(finding.text, finding)
            where.setdefault(finding.text, []).append(log.source.label)
    texts = {
        text: _sentence(f, where[text] if len(where[text]) < len(logs) else [])
        for text, f in found.items()
    }
    certain = [text for text, finding in found.items() if finding.severity == "error"]
    if certain:
        mend = together(found[text].mend for text in certain)
        message = " ".join(texts[text] for text in certain)
        way = f" {found[certain[0]].way_out}" if not mend else " If so, " + say_so(mend)
        raise SuspiciousLogError(
            f"{message}{way}\nIf the columns are right, " + say_so(_TRUST),
            [found[text] for text in certain],
        )
    return [f"{text} {found[key].way_out}" for key, text in texts.items()]


def motionless(robot: Robot, logs: Sequence[Log]) -> LogFinding | None:
    """Return what to do about logs without motion, None where there is some.

    A log whose every channel is constant is no measurement. Where joints only flicker by the noise
    of their sensors, they must at least stand elsewhere in another log.
    """
    way = "Record the robot in motion; if it moved, the columns are not connected."
    dead = [log for log in logs if log.columns and not any(map(np.ptp, log.columns.values()))]
    joints = [j for j in robot.single_joints if any(log.has(f"{j}.position") for log in logs)]
    held = [
        [log.column(f"{j}.position") for log in logs if log.has(f"{j}.position")] for j in joints
    ]
    moves = not joints or any(
        set(joints) & set(log.with_quantity("position")) - resting_joints(log) for log in logs
    )
    apart = [np.ptp([np.mean(v) for v in each]) > 3.0 * max(map(np.ptp, each)) for each in held]
    if moves or any(apart):
        if not dead:
            return None
        names = ", ".join(log.source.label for log in dead)
        text = f"{names}: every channel is constant, and no joint moves in this log."
        return LogFinding("error", "constant_log", "", text, f"Leave it out. {way}")
    which = "this log" if len(logs) == 1 else "these logs"
    text = f"no joint moves in {which}: every position is constant, but for noise."
    return LogFinding("error", "constant_log", "", f"{logs[0].source.label}: {text}", way)


def require_plausible_units(log: Log) -> None:
    """Check that time, position and velocity of each joint agree with each other.

    Raises:
        SuspiciousLogError: the ratio of velocity to d position / d time is that of a known
            mistake, or the time stamps are so far apart that they cannot be seconds.
    """
    certain = [f for f in (_trusted(f, log) for f in _of_motion(log, {})) if f.severity == "error"]
    if certain:
        first = certain[0]
        raise SuspiciousLogError(f"{log.source.label}: {first.text} {first.way_out}", certain)


def single_ratios(robot: Robot) -> dict[str, float]:
    """Return N of the joints that one motor drives alone (row and column of D are the identity)."""
    gears = robot.transmission
    topology = np.abs(gears.topology - np.eye(gears.size)) > 0.0
    return {
        joint: float(gears.gear_ratio[k])
        for k, joint in enumerate(gears.joints)
        if not topology[k].any() and not topology[:, k].any()
    }


def _mended(log: Log, found: Sequence[LogFinding]) -> Log:
    """Return a log without the mistakes that are certain."""
    return mended(log, together(f.mend for f in found if _certain(f)))


def _certain(finding: LogFinding) -> bool:
    return finding.probability >= CERTAIN and bool(finding.mend)


def _trusted(finding: LogFinding, log: Log) -> LogFinding:
    if not log.source.trusted or finding.severity != "error":
        return finding
    return replace(finding, severity="warning")


def _severity(probability: float) -> str:
    return "error" if probability >= CERTAIN else "warning"


def _sentence(finding: LogFinding, labels: Sequence[str]) -> str:
    return f"{', '.join(labels)}: {finding.text}" if labels else finding.text


def _of_motion(log: Log, ratios: Mapping[str, float]) -> list[LogFinding]:
    """Return what position, velocity and clock of a log say about each other."""
    mistakes = motion_mistakes(log, ratios)
    groups: dict[str, list[MotionMistake]] = {}
    for mistake in mistakes:
        groups.setdefault(mistake.ratio.text, []).append(mistake)
    found = [_of_group(group) for group in groups.values()]
    clocks = [f for f in found if f.kind == "time_unit"]
    probability, unit = slow_clock(log)
    if not clocks and probability >= LIKELY:
        text = (
            f"the time stamps are {log.sample_time:g} s apart, too far for the motion of a robot: "
            f"the time is in {unit}?"
        )
        mend: Mend = {"time": {"unit": unit}}
        way = "If so, " + say_so(mend)
        severity = _severity(probability)
        found.append(LogFinding(severity, "time_unit", "time", text, way, mend, probability))
    return found


def _of_group(group: Sequence[MotionMistake]) -> LogFinding:
    first = group[0]
    columns = listed([f"'{one.joint}.velocity'" for one in group])
    scales = listed([f"{one.scale:.4g}" for one in group])
    text = (
        f"{columns} {'is' if len(group) == 1 else 'are'} {scales} times the derivative of the "
        f"position: {first.ratio.text}?"
    )
    mend = together(one.mend for one in group)
    probability = together_likely([one.probability for one in group])
    column = next(iter(mend.get("columns", {"time": None})))
    return LogFinding(
        _severity(probability),
        first.ratio.kind,
        column,
        text,
        "If so, " + say_so(mend),
        mend,
        probability,
    )


def _shared(found: Sequence[Sequence[LogFinding]]) -> list[list[LogFinding]]:
    """Return the findings, those that several logs show with the probability of all together."""
    shown: dict[str, list[float]] = {}
    for finding in (f for own in found for f in own):
        shown.setdefault(repr(finding.mend), []).append(finding.probability)
    likely = {mend: together_likely(each) for mend, each in shown.items()}
    return [
        [
            replace(f, severity=_severity(p), probability=p)
            for f, p in ((f, likely[repr(f.mend)]) for f in own)
        ]
        for own in found
    ]


def _of_torque(mistake: Mistake, logs: Sequence[Log]) -> LogFinding:
    way = "If so, " + say_so(mistake.mend)
    if mistake.kind == "gear_ratio":
        seen = f"{mistake.text}?"
        way = "Check gear_ratio in robot.toml, and whether the logs are of this robot."
    elif mistake.kind == "torque_scale":
        seen, way = f"{mistake.text}.", _SCALE
    elif mistake.kind in _GRAVITY and not mistake.others:
        seen, way = f"{_suspected(mistake)} {_seen(mistake)}", f"If so, {_GRAVITY[mistake.kind]}"
    else:
        if mistake.others or mistake.probability < LIKELY:
            rivals = ((mistake.text, mistake.mend), *mistake.others)
            known = [
                f"If you know that {text}, {say_so(mend) if mend else _of_robot(text)}"
                for text, mend in rivals
            ]
            way = "\n".join((_MORE, *known))
        if len(mistake.logs) < len(logs):
            way = "Read these logs with a map of their own. " + way
        seen = f"{_suspected(mistake)} {_seen(mistake)}"
    return LogFinding(
        _severity(mistake.probability),
        mistake.kind,
        mistake.columns[0] if mistake.columns else "",
        seen,
        way,
        {} if mistake.others else mistake.mend,
        mistake.probability,
        mistake.mend,
    )


def _of_robot(text: str) -> str:
    """Return what the description of the robot must say where no column map mends a mistake."""
    return _GRAVITY["upside_down" if "upside down" in text else "no_gravity"]


def _suspected(mistake: Mistake) -> str:
    """Return what may be wrong, and whether the logs can tell it."""
    logs = "one log" if len(mistake.logs) == 1 else "these logs"
    rivals = ", or ".join([mistake.text, *(text for text, _ in mistake.others)])
    if mistake.probability < LIKELY:
        return f"{logs} cannot tell whether the columns are right: perhaps {rivals}."
    cannot = f" {logs[0].upper()}{logs[1:]} cannot tell which." if mistake.others else ""
    return f"{rivals}?{cannot}"


def _seen(mistake: Mistake) -> str:
    if mistake.scale != 1.0:
        return f"The reported torque is {mistake.scale:.3g} times what the motion needs."
    then, now = 100.0 * mistake.then, 100.0 * mistake.explained
    so = "If the first is true" if mistake.others else "So read"
    return (
        f"{so}, the robot explains {then:.0f} % of the power of the reported torque, and "
        f"{now:.0f} % as it stands."
    )


LIKELY = 0.9
"""Probability from which a mistake is worth a warning."""
POSSIBLE = 0.5
"""Probability of any mistake from which logs leave open whether they are right. Of ten right logs
of 5 to 10 s (seven of a recorded double pendulum, three of the sample leg) none is above 0.04."""
CERTAIN = 0.99
"""Probability from which a mistake stops a diagnosis."""
# Share of a report's power left, from which its column may be another joint's. Of 2114 true reports
# of generated robots with hidden causes 2 % leave more than 0.13, 8 % more than 0.015. Exchanged
# torques of the sample leg leave 0.093 at the knee: the lower share asks the evidence about them.
_LOST, _LOST_OF_FEW = 0.3, 0.015
_TIED = 2.0  # nats: odds of seven to one
_PAIRS = 7  # driven joints up to which many may be exchanged: a third of a second per log
# Share of the power of a report that a reading must explain to accuse anybody: with counts for
# radians degrees explain .01 "better" than nothing; the true readings of the tests .46 and more.
_LEAST_EXPLAINED = 0.25
_RARELY_LEFT = 0.13  # of a report: what leaves more is no ground for a doubt (see above)
_OTHER_RATIO = float(np.log(0.02))  # as often as another unit of all columns
_SAME_RATIO = 0.1  # of ln of the factor, below which nobody would call it another gear
_MOST_PARTS = 0.6  # of the logs, in which a correction must bring reports closer to the need
# Standard deviation of ln of a gain where nothing is wrong: root mean square .036 of 32 joints of
# twelve recorded and generated machines whose gains are known to .05.
_SAME_SCALE = 0.036
_LINKS_WRONG = float(np.log(0.15))  # every joint has its own factor: in two of 13 recorded machines
_MOST = 3  # mistakes that are looked for one after another


@dataclass(frozen=True)
class Mistake:
    """A reading of the logs that is likelier than the logs as they stand.

    Attributes:
        kind: short name for machines.
        text: what is wrong, as a clause.
        columns: the columns that are wrong.
        mend: what a column map says about it.
        probability: that the logs have this mistake, or one that cannot be told from it.
        explained: share of the reported torque's power that the robot explains as it stands ...
        then: ... and read so, over the joints that it concerns.
        others: what it cannot be told from, with what a column map says about each. Where there
            is any, the logs say that something is wrong and not what: nothing is mended then.
        logs: numbers of the logs that have it.
        scale: reported torque over what the motion needs, as it stands; 1 where only signs or
            places change.
    """

    kind: str
    text: str
    columns: tuple[str, ...]
    mend: Mend
    probability: float
    explained: float
    then: float
    others: tuple[tuple[str, Mend], ...]
    logs: tuple[int, ...]
    scale: float = 1.0


def torque_mistakes(robot: Robot, logs: Sequence[Log]) -> list[Mistake]:
    """Return the mistakes in the columns of logs, one after another, each on mended logs.

    Mistakes of all logs come first; then those of single logs.

    Args:
        robot: the robot that the user believes in.
        logs: of it; those that cannot be held against it are passed over.
    """
    found: list[Mistake] = []
    current = list(logs)
    while len(found) < _MOST:
        judged = _tables(robot, current)
        mistakes = _of_all(robot, judged)
        shared = mistakes and mistakes[0].probability >= LIKELY
        if not shared or _better_alone(judged, mistakes[0]):
            mistakes = _of_some(judged) or mistakes
        if not mistakes:
            return found or _other_scale(robot, judged) or _late(judged)
        found += mistakes
        certain = [m for m in mistakes if m.probability >= CERTAIN and m.mend and not m.others]
        if not certain:
            return found
        for mistake in certain:
            for k in mistake.logs:
                current[k] = mended(current[k], mistake.mend)
    return found


@dataclass(frozen=True, eq=False)
class _Judged:
    reading: Reading
    reports: tuple[Report, ...]
    unrelated: FloatArray
    strays: FloatArray


_Table = dict[str, _Judged]


def _tables(robot: Robot, logs: Sequence[Log]) -> dict[int, _Table]:
    """Return every reading of each log that can be held against the robot, by its text."""
    each = {k: rows_of(robot, log) for k, log in enumerate(logs)}
    known = {k: rows for k, rows in each.items() if rows is not None}
    alike = {k: len(group) for group in find_repeats(logs) for k in group}
    step = max((logs[k].sample_time for k in known), default=0.0)
    lag, _ = common_lag(list(known.values()), step)
    benches = {k: Bench(rows, 1.0 / alike.get(k, 1)) for k, rows in known.items()}
    least = _LOST_OF_FEW if robot.transmission.size <= _PAIRS else _LOST
    # A mistake of all logs must be read in all of them: what one log shows is asked of the others.
    lost, doubtful = np.zeros(robot.transmission.size, dtype=bool), False
    for k, bench in benches.items():
        left = np.array([one.left for one in bench.reports(as_it_stands(known[k]))])
        lost |= left > least
        doubtful |= bool(np.any(left > _LOST_OF_FEW))
    return {
        k: {
            reading.text: _Judged(
                reading, bench.reports(reading), bench.unrelated(reading), bench.strays(reading)
            )
            for reading in readings(known[k], logs[k], lost, doubtful, lag)
        }
        for k, bench in benches.items()
    }


def _of_all(robot: Robot, judged: Mapping[int, _Table]) -> list[Mistake]:
    """Return the likeliest mistake that all logs share, if it is likelier than none."""
    if not judged:
        return []
    shared = set.intersection(*(set(table) for table in judged.values()))
    first = next(iter(judged.values()))
    texts = [text for text in first if text in shared]
    score = [_score(text, judged) for text in texts]
    return _another_ratio(robot, score, judged) or _likely(texts, np.array(score), judged, POSSIBLE)


def _other_scale(robot: Robot, judged: Mapping[int, _Table]) -> list[Mistake]:
    """Return the torques that are as many times too large in all joints, or in one alone.

    A gear ratio, a torque constant and masses make the same factor; only a remark comes of it.
    """
    if not judged or robot.transmission.size < 2:
        return []
    each = [table[""].reports for table in judged.values()]
    # A report that the need does not explain tells no gain.
    clear = np.array([[one.left < 4.0 * _LOST_OF_FEW for one in reports] for reports in each])
    held = clear * np.array([[one.spread**-2.0 for one in reports] for reports in each])
    gains = np.array([[max(one.gain, 1e-300) for one in reports] for reports in each])
    told = np.maximum(held.sum(axis=0), 1e-300)
    size, sure = np.sum(held * np.log(gains), axis=0) / told, 1.0 / (1.0 / told + _SAME_SCALE**2)
    names = list(robot.transmission.joints)

    def shown(joints: list[int]) -> tuple[float, float]:
        """Evidence for one factor on joints, over none; and the likeliest factor."""
        whole = sure[joints].sum() + GAIN_SPREAD**-2.0
        mean = float(sure[joints] @ size[joints]) / whole
        return 0.5 * (whole * mean**2 - np.log(whole * GAIN_SPREAD**2)), float(np.exp(mean))

    single = [shown([k]) for k in range(len(names))]
    all_apart = _LINKS_WRONG + sum(odds for odds, _ in single)
    rivals = [([*range(len(names))], shown([*range(len(names))]))]
    rivals += [([k], one) for k, one in enumerate(single)]
    odds = _OTHER_RATIO + np.array([one[0] for _, one in rivals])
    best = int(np.argmax(odds))
    if odds[best] < np.logaddexp(0.0, np.logaddexp(all_apart, logsumexp(np.delete(odds, best)))):
        return []
    joints, (_, factor) = rivals[best]
    first = next(iter(judged.values()))[""].reading
    which = ", ".join(names[k] for k in joints)
    text = f"torques of {which} are {factor:.2g} times what the links need"
    return [Mistake("torque_scale", text, (), first.mend, 0.5, 0.0, 0.0, (), tuple(judged))]


def _late(judged: Mapping[int, _Table]) -> list[Mistake]:
    """Return the lag that all torques share, where it explains too little to be certain."""
    if not judged:
        return []
    shared = [text for text, one in next(iter(judged.values())).items() if one.reading.lag]
    return [_mistake(text, judged, POSSIBLE) for text in shared]


def _better_alone(judged: Mapping[int, _Table], shared: Mistake) -> bool:
    """Whether a mistake of one log explains the logs better than one that all of them share."""
    if len(judged) < 2 or not shared.mend:
        return False
    best = max(
        _score(text, {k: table}, [one[""] for other, one in judged.items() if other != k])
        for k, table in judged.items()
        for text in table
        if text
    )
    return bool(best - np.log(len(judged)) > _score(shared.text, judged))


def _score(text: str, judged: Mapping[int, _Table], beside: Sequence[_Judged] = ()) -> float:
    """Return the log of prior times evidence of a reading of some logs, beside others as is."""
    if not _closer(text, judged):
        return -np.inf
    each = [*(table[text] for table in judged.values()), *beside]
    return each[0].reading.prior + evidence([(one.reports, one.unrelated) for one in each])


def _closer(text: str, judged: Mapping[int, _Table]) -> bool:
    """Whether a reading brings reports closer to the need: in all, and in most parts of the logs.

    A correction that does not, explains the reports by its gain and friction, and not by the links.
    """
    if not text:
        return True
    before, after = [], []
    for table in judged.values():
        as_is, read = table[""], table[text]
        other = [one is not two for one, two in zip(as_is.reports, read.reports, strict=True)]
        before += list(as_is.strays[:, other].sum(axis=1))
        after += list(read.strays[:, other].sum(axis=1))
    better = np.array(after) < np.array(before)
    return bool(sum(after) < sum(before) and np.mean(better) > _MOST_PARTS)


def _another_ratio(
    robot: Robot, score: Sequence[float], judged: Mapping[int, _Table]
) -> list[Mistake]:
    """Return that the robot's gear ratios are others, if that is likelier than all mistakes."""
    if not np.all(robot.transmission.reflected_inertia > 0.0):
        return []
    total, factor = ratio_evidence([table[""].reports for table in judged.values()])
    doubt = float(
        np.exp(_OTHER_RATIO + total - np.logaddexp(logsumexp(score), _OTHER_RATIO + total))
    )
    if doubt < LIKELY or abs(np.log(factor)) < _SAME_RATIO:
        return []
    before, _ = _explained("", judged)
    ratios = ", ".join(f"{factor * N:.3g}" for N in robot.transmission.gear_ratio)
    text = (
        f"the gear ratios of the robot are {factor:.2f} times those that the description states "
        f"({ratios}; the torque and the inertia of the rotors agree on it)"
    )
    return [Mistake("gear_ratio", text, (), {}, doubt, before, before, (), tuple(judged))]


def _of_some(judged: Mapping[int, _Table]) -> list[Mistake]:
    """Return the likeliest mistake of each log that has one of its own."""
    if len(judged) < 2:
        return []
    found: dict[str, list[Mistake]] = {}
    for k, table in judged.items():
        beside = [one[""] for other, one in judged.items() if other != k]
        score = np.array([_score(text, {k: table}, beside) for text in table])
        for mistake in _likely(list(table), score, {k: table}):
            found.setdefault(mistake.text, []).append(mistake)
    return [_joined(mistakes) for mistakes in found.values()]


def _likely(
    texts: list[str], score: FloatArray, judged: Mapping[int, _Table], least: float = LIKELY
) -> list[Mistake]:
    odds = score - logsumexp(score)
    stands = texts.index("")
    doubt = float(-np.expm1(odds[stands]))
    ranked = [int(i) for i in np.argsort(-score) if i != stands]
    if not ranked or doubt < least:
        return []
    best = ranked[0]
    others = [texts[i] for i in ranked[1:4] if score[best] - score[i] < _TIED]
    mistake = _mistake(texts[best], judged, doubt, others)
    least = _LEAST_EXPLAINED if doubt >= LIKELY else 1.0 - _RARELY_LEFT
    return [mistake] if mistake.then >= least else []


def _mistake(
    text: str, judged: Mapping[int, _Table], doubt: float, others: Sequence[str] = ()
) -> Mistake:
    table = next(iter(judged.values()))
    reading = table[text].reading
    return Mistake(
        reading.kind,
        reading.text,
        reading.columns,
        reading.mend,
        doubt if reading.told else min(doubt, POSSIBLE),
        *_explained(text, judged),
        tuple((other, table[other].reading.mend) for other in others),
        tuple(judged),
        _scale(table[text]),
    )


def _scale(judged: _Judged) -> float:
    """Return how many times too large the torques are that a reading scales, 1 for none."""
    factor = judged.reading.torque_factor
    changed = [k for k in range(factor.size) if abs(factor[k]) != 1.0]
    if not changed:
        return 1.0
    gains = [np.log(judged.reports[k].gain / abs(factor[k])) for k in changed]
    return float(np.exp(np.mean(gains)))


def _explained(text: str, judged: Mapping[int, _Table]) -> tuple[float, float]:
    """Return the mean share of power explained before and after, of the joints that change."""
    pairs = [
        (one.left, other.left)
        for table in judged.values()
        for one, other in zip(table[""].reports, table[text].reports, strict=True)
        if one is not other
    ]
    before, after = np.clip(np.mean(pairs, axis=0), 0.0, 1.0) if pairs else (1.0, 1.0)
    return float(1.0 - before), float(1.0 - after)


def _joined(mistakes: Sequence[Mistake]) -> Mistake:
    """Return one mistake of several logs."""
    first = mistakes[0]
    return Mistake(
        first.kind,
        first.text,
        first.columns,
        first.mend,
        min(m.probability for m in mistakes),
        float(np.mean([m.explained for m in mistakes])),
        float(np.mean([m.then for m in mistakes])),
        first.others,
        tuple(k for m in mistakes for k in m.logs),
        first.scale,
    )
