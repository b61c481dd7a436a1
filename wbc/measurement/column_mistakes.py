"""Mistakes that the columns of a log show by themselves: angles that wrap, rows of zeros from a
second publisher, torques without a sign, units and signs of position, velocity and clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import log, log2, pi
from typing import Any

import numpy as np
from scipy.special import expit, logsumexp

from wbc.arrays import FloatArray
from wbc.measurement.checks import true_runs
from wbc.measurement.clocks import ENCODER_BITS, PERIODS, gaps, period
from wbc.measurement.column_map import ColumnRule, Mend, parse_column_map, say_so, together
from wbc.measurement.filters import jumps, velocity_fits
from wbc.measurement.log import LIKELY, Log, LogFinding, listed, severity
from wbc.measurement.schema import LOG_UNITS, reported

_SAME_JUMP = 0.1  # share by which jumps of one wrap differ: the joint moves on meanwhile
_STALE_SHARE = 0.4  # of the rows that a second publisher may have filled
_FASTEST = 0.99  # of the steps between rows are those of the motion; others may be jumps
_FOLDS = 5  # times that a torque must be mirrored at zero; a smooth minimum is no fold
_FOLD_ROWS = 4  # rows to either side over which the slope at a fold is taken
_RESET = "no turn and no range of counts; a counter that was reset"
_NEAR_ZERO = 0.05  # of the range of a torque

# How often a set of logs has a mistake of a kind: a judgement, nobody counted. A factor 3 moves a
# decision by one nat; clear cases have ten or more.
EVERYWHERE = log(0.02)
_COUNTS = 100.0  # rad: sixteen turns in whole numbers, which no joint of an arm or leg makes
COUNTS_OF_A_TURN = {1 << bits: float(f"{2.0 * pi / (1 << bits):.10g}") for bits in ENCODER_BITS}
"""Counts of an encoder in a turn -> what one of them is worth [rad]."""
CLOCKS = ("ms", "us", "ns")
"""Units that time stamps may have instead of seconds."""


_DEGREES, _TURNS, _THOUSANDTHS = {"unit": "deg"}, {"unit": "turn"}, {"scale": 0.001}
_RPM, _PER_TURN, _PER_DEGREE = {"unit": "rpm"}, {"unit": "turn/s"}, {"unit": "deg/s"}
# What velocity beside position of a joint shows: kind, clause, and what a map says of each.
_OF_MOTION: tuple[tuple[str, str, Mapping[str, Any], Mapping[str, Any]], ...] = (
    ("degrees", "the position is in degrees", _DEGREES, {}),
    ("degrees", "the velocity is in deg/s", {}, _PER_DEGREE),
    ("velocity_unit", "the velocity is in rpm", {}, _RPM),
    ("velocity_unit", "the velocity is in turns/s", {}, _PER_TURN),
    ("degrees", "the position is in turns", _TURNS, {}),
    ("degrees", "the position is in degrees, the velocity in rpm", _DEGREES, _RPM),
    ("degrees", "the position is in degrees, the velocity in turns/s", _DEGREES, _PER_TURN),
    ("degrees", "the position is in turns, the velocity in rpm", _TURNS, _RPM),
    ("degrees", "the position is in turns, the velocity in deg/s", _TURNS, _PER_DEGREE),
    ("velocity_unit", "the position is in thousandths of the velocity's unit", _THOUSANDTHS, {}),
    ("velocity_sign", "position and velocity have opposite signs", {}, {"sign": -1}),
    ("gear_side", "the velocity is that of the rotor", {}, {"side": "rotor"}),
    ("gear_side", "the position is that of the rotor", {"side": "rotor"}, {}),
    ("gear_side", "the velocity is that of the rotor, in rpm", {}, {"side": "rotor", **_RPM}),
)


def of_motion(joint: str, ratio: float, counted: bool) -> Iterator[tuple[str, str, Mend]]:
    """Yield (kind, clause, mend) of the mistakes that velocity beside position of a joint shows.

    Args:
        joint: its name.
        ratio: N of its gear, 1 where none is known.
        counted: whether its position holds encoder counts.
    """
    for kind, text, *entries in _OF_MOTION:
        side = {"gear_ratio": ratio} if kind == "gear_side" else {}
        if not side or (abs(ratio) != 1.0 and np.isfinite(ratio)):
            both = zip((f"{joint}.position", f"{joint}.velocity"), entries, strict=True)
            yield kind, text, {"columns": {name: {**own, **side} for name, own in both if own}}
    for turn, worth in COUNTS_OF_A_TURN.items() if counted else ():
        mend = {"columns": {f"{joint}.position": {"scale": worth}}}
        yield "counts", f"the position counts {turn} a turn", mend
    yield from (("time_unit", f"the time is in {u}", {"time": {"unit": u}}) for u in CLOCKS)


def whole_counts(log: Log) -> list[str]:
    """Return the positions that hold encoder counts: whole numbers, far beyond turns."""
    names = [f"{joint}.position" for joint in log.with_quantity("position")]
    far = [name for name in names if np.ptp(log.column(name)) > _COUNTS]
    return [name for name in far if np.array_equal(log.column(name), np.round(log.column(name)))]


def wraps(log: Log) -> list[LogFinding]:
    """Return the positions that jump by their period, or by the bit that holds their sign.

    Below zero, counts with a sign begin again at 2^bit and grow with the distance from zero.
    """
    found, degrees, holes = list[LogFinding](), False, gaps(log.time)
    names = [n for n in log.names if n.endswith((".position", ".rotor_position"))]
    for name in names:
        values = log.column(name)
        # Where samples are missing a joint that moves on jumps without any wrap.
        rows = np.setdiff1d(jumps(values), holes)
        if not rows.size:
            continue
        sizes = np.abs(np.diff(values)[rows])
        bit = int(log2(max(1.0, values.max())))
        signed = ColumnRule(name, (name,), (1.0,), sign_bit=bit).value({name: values})
        counted = bit >= 8 and values.min() >= 0.0 and not (values % 1.0).any()
        if counted and not jumps(signed).size:
            text = f"counts from {1 << bit} on mirror those below: bit {bit} is a sign."
            found.append(_suspected("wrap", name, text, {"columns": {name: {"sign_bit": bit}}}))
        elif np.ptp(sizes) <= _SAME_JUMP * (size := float(sizes.mean())):
            turn = float(period(sizes.mean()))
            degrees |= turn == 360.0
            entry = {"unwrap": turn or size, **({"unit": "deg"} if turn == 360.0 else {})}
            text = f"{rows.size} jumps of {size:.6g} ({PERIODS.get(turn, _RESET)}), the first at "
            text += f"row {rows[0] + 1}."
            one = _suspected("wrap", name, text, {"columns": {name: entry}})
            found.append(one if turn else replace(one, mend={}))
    left = {*names} - {finding.column for finding in found} if degrees else set()
    for name in sorted(n for n in left if n.endswith(".position")):
        if float(np.abs(log.column(name)).max()) > 2.0 * pi:
            text = "beyond a turn, beside positions that wrap at 360: in degrees, too."
            # The turn that is nearest to zero, as for the others.
            mend = {"columns": {name: {"unit": "deg", "unwrap": 360.0}}}
            found.append(_suspected("degrees", name, text, mend))
    return found


def stale_rows(log: Log) -> list[LogFinding]:
    """Return what to do about rows in which every position is zero, though the joints are not.

    A second publisher on the same topic, or a message of a driver that starts, leaves them.
    """
    names = [f"{joint}.position" for joint in log.with_quantity("position")]
    moving = [name for name in names if np.ptp(log.column(name)) > 0.0]
    values = np.array([log.column(name) for name in moving]).reshape(-1, len(log)).T
    zero = np.all(values == 0.0, axis=1)
    at, rest = np.flatnonzero(zero), np.flatnonzero(~zero)
    if not 0 < at.size < _STALE_SHARE * len(log):
        return []
    # A joint that passes or rests at zero comes from near there, and not at twice its speed.
    path = np.array([np.interp(at, rest, column[rest]) for column in values.T])
    steps = np.abs(np.diff(values[rest], axis=0)).max(axis=1)[np.diff(rest) == 1]
    if np.median(np.abs(path).max(axis=0)) <= 2.0 * np.quantile(steps, _FASTEST):
        return []
    mend = {"columns": {name: {"empty": 0.0, "missing": "drop_rows"} for name in moving}}
    text = f"{at.size} of {len(log)} rows hold zero in {', '.join(moving)}, the first at row "
    text += f"{at[0]}, while the joints are elsewhere: of a second publisher or a driver's start."
    return [LogFinding("error", "stale", moving[0], text, "To drop them, " + say_so(mend), mend)]


def magnitudes(logs: Sequence[Log]) -> list[LogFinding]:
    """Return the refusal of torques that are magnitudes without a sign, for all logs together.

    Drives of one kind report alike: none of the torques is ever on the other side of zero, though
    they come down to it and rise again as steeply as they came.
    """
    names = reported(logs[0].columns if logs else ())
    held = {name: [log.column(name) for log in logs if log.has(name)] for name in names}
    known = [name for name, values in held.items() if any(map(np.any, values))]
    folds = mirrored([values for name in known for values in held[name]])
    if not folds:
        return []
    text = f"{', '.join(known)} {'is' if len(known) == 1 else 'are'} never below zero and mirrored "
    text += f"there {folds} times: a magnitude without sign, which is no torque."
    way = "Record the current or torque with its sign (servos keep it in a bit of its own). If the "
    way += "targets of the drives are recorded, they make the torque: state kp and kd in "
    leave = say_so({"columns": dict.fromkeys(known, False)}, "leave the magnitudes out")
    way += f"robot.toml, map the targets, and {leave}"
    return [LogFinding("error", "torque_magnitude", known[0], text, way)]


def mirrored(torques: Sequence[FloatArray]) -> int:
    """Return how often torques of one kind are mirrored at zero, 0 if they have a sign."""
    moved = [values for values in torques if np.any(values)]
    if len({end for v in moved for end in np.sign([v.min(), v.max()]).tolist()} - {0.0}) != 1:
        return 0
    folds = sum(_folds(np.abs(values)) for values in moved)
    return folds if folds >= _FOLDS else 0


def _folds(values: FloatArray) -> int:
    """Return how often a channel comes down to zero and rises again as steeply."""
    width = _FOLD_ROWS
    if values.size < 10 * width:
        return 0
    slope = (values[width:] - values[:-width]) / width
    steep = 0.5 * float(np.sqrt(np.mean(slope**2)))
    starts, ends = true_runs(values <= _NEAR_ZERO * float(np.quantile(values, 0.99)))
    rows = (starts + ends - 1) // 2
    rows = rows[(rows >= width) & (rows < values.size - width)]
    return int(np.count_nonzero((slope[rows - width] < -steep) & (slope[rows] > steep)))


# Of ln of velocity over d position / d time: (share, standard deviation). Of 136 channels of six
# recorded machines and the practice leg 82 % are within 0.003 of one; filters and delays make more.
_RATIO_SPREADS = ((0.8, 0.002), (0.2, 0.03))
_ODD = ((0.02 / 2.0, 2.0),)  # share and spread of ratios that have another cause, either way
_CORRELATION = 0.95
# What is usual, as logarithms with standard deviations. Judgements: sample times of 0.5 to 50 ms,
# logs of 0.5 s to half an hour, the fastest joint at 0.15 to 60 rad/s (m/s). Up to twelve logs of
# each of ten recorded machines have 0.2 to 10 ms, 0.6 to 51 s and 0.07 to 18 rad/s (m/s).
_USUAL_STEP, _STEP_SPREAD = log(0.005), 1.2
_USUAL_LENGTH, _LENGTH_SPREAD = log(30.0), 2.0
_USUAL_SPEED, _SPEED_SPREAD = 3.0, 1.5
_SPEED_ROWS = 200


def motion_findings(logs: Sequence[Log], ratios: Mapping[str, float]) -> list[list[LogFinding]]:
    """Return for every log what its position, velocity and clock say about each other.

    A mistake that several joints and logs show was made once: its prior counts once, and what they
    show adds up.

    Args:
        logs: the logs.
        ratios: gear ratio N of joints that one motor drives alone; may be empty.
    """
    shown: dict[tuple[str, str], list[tuple[int, str, float, Mend, float]]] = {}
    for k, own in enumerate(logs):
        counted, timed = whole_counts(own), False
        for joint, fit in velocity_fits(own).items():
            if abs(fit.correlation) <= _CORRELATION:
                continue
            known = [*of_motion(joint, ratios.get(joint, 1.0), f"{joint}.position" in counted)]
            odds = EVERYWHERE + np.array([_log_density(fit.scale, m) for *_, m in known])
            best, odd = int(np.argmax(odds)), log_mixture(np.log(abs(fit.scale)), _ODD)
            others = [*np.delete(odds, best), _log_density(fit.scale, {}), odd]
            likely = float(odds[best] - logsumexp(others))
            if expit(likely) >= LIKELY:
                kind, said, mend = known[best]
                timed |= kind == "time_unit"
                shown.setdefault((kind, said), []).append((k, joint, fit.scale, mend, likely))
        likely, unit = slow_clock(own)
        if expit(likely) >= LIKELY and not timed:
            what = (k, "", 1.0, {"time": {"unit": unit}}, likely)
            shown.setdefault(("time_unit", f"the time is in {unit}"), []).append(what)
    found: list[list[LogFinding]] = [[] for _ in logs]
    for (kind, said), group in shown.items():
        probability = float(expit(sum(odds - EVERYWHERE for *_, odds in group) + EVERYWHERE))
        for k in dict.fromkeys(number for number, *_ in group):
            _, joints, scales, mends, _ = zip(*(one for one in group if one[0] == k), strict=True)
            names = listed([f"'{joint}.velocity'" for joint in joints])
            verb, times = "is" if len(joints) == 1 else "are", listed([f"{x:.4g}" for x in scales])
            text = f"{names} {verb} {times} times the derivative of the position: {said}?"
            if not all(joints):
                text = f"the time stamps are {logs[k].sample_time:g} s apart, too far for the "
                text += f"motion of a robot: {said}?"
            mend = together(mends)
            column = next(iter(mend.get("columns", {"time": None})))
            found[k].append(_suspected(kind, column, text, mend, probability))
    return found


def _suspected(
    kind: str, column: str, text: str, mend: Mend, probability: float = 1.0
) -> LogFinding:
    way = "If so, " + say_so(mend)
    return LogFinding(severity(probability), kind, column, text, way, mend, probability)


def slow_clock(log: Log) -> tuple[float, str]:
    """Return the log odds that the time stamps are no seconds, and the unit that they have.

    From their distance, the length of the log and the speed of its fastest joint. Each alone leaves
    it open: a controller may run at 5 kHz, a log may be long, and a joint may creep.
    """
    worth, speed = np.array([LOG_UNITS[unit][1] for unit in ("s", *CLOCKS)]), _fastest(log)
    step = (np.log(worth * log.sample_time) - _USUAL_STEP) / _STEP_SPREAD
    length = (np.log(worth * log.duration) - _USUAL_LENGTH) / _LENGTH_SPREAD
    fast = (np.log((speed or _USUAL_SPEED) / worth) - np.log(_USUAL_SPEED)) / _SPEED_SPREAD
    odds = -0.5 * (step**2 + length**2 + (fast**2 if speed else 0.0))
    odds[1:] += EVERYWHERE
    return float(logsumexp(odds[1:]) - odds[0]), CLOCKS[int(odds[1:].argmax())]


def _fastest(log: Log) -> float:
    """Return the highest speed of any joint between rows far apart: no noise, no resolution."""
    places = np.unique(np.linspace(0, len(log) - 1, _SPEED_ROWS).astype(int))
    moved = np.diff(log.stack("position")[places], axis=0)
    return float(np.max(np.abs(moved) / np.diff(log.time[places])[:, None], initial=0.0))


def _log_density(scale: float, mend: Mend) -> float:
    """Return the log density of velocity over d position / d time in a log that needs a mend."""
    rules = parse_column_map(mend)
    by = {rule.target.rpartition(".")[2]: rule.factors[0] for rule in rules.rules}
    right = scale * by.get("velocity", 1.0) * rules.time.factor / by.get("position", 1.0)
    return float(log_mixture(np.log(right), _RATIO_SPREADS)) if right > 0.0 else -np.inf


def log_mixture(away: FloatArray, parts: Iterable[tuple[float, float]]) -> FloatArray:
    """Return the log density, up to a constant, of normal distributions about zero.

    Args:
        away: (...) where it is asked for.
        parts: share and standard deviation of each.
    """
    each = [np.log(share / s) - 0.5 * (away / s) ** 2 for share, s in parts]
    return np.asarray(np.logaddexp.reduce(each))  # SciPy's takes ten times as long for so few
