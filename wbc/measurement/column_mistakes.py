"""Mistakes that the columns of a log show by themselves: angles that wrap, rows of zeros from a
second publisher, torques without a sign, units and signs of position, velocity and clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import log, log2, pi
from typing import Any

import numpy as np
from scipy.special import logsumexp

from wbc.arrays import FloatArray
from wbc.measurement.checks import true_runs
from wbc.measurement.clocks import ENCODER_BITS, PERIODS, gaps, period
from wbc.measurement.column_map import Mend, parse_column_map, say_so, together
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


def of_motion(joint: str, ratio: float, counted: bool) -> Iterator[tuple[str, str, Mend]]:
    """Yield (kind, clause, mend) of the mistakes that velocity beside position of a joint shows.

    Args:
        joint: its name.
        ratio: N of its gear, 1 where none is known.
        counted: whether its position holds encoder counts.
    """
    position, velocity = f"{joint}.position", f"{joint}.velocity"
    rotor = {"side": "rotor", "gear_ratio": ratio}
    ways: list[tuple[str, str, str, Mapping[str, Any]]] = [
        ("degrees", "the position is in degrees", position, {"unit": "deg"}),
        ("degrees", "the velocity is in deg/s", velocity, {"unit": "deg/s"}),
        ("velocity_unit", "the velocity is in rpm", velocity, {"unit": "rpm"}),
        ("velocity_unit", "the velocity is in turns/s", velocity, {"unit": "turn/s"}),
        ("degrees", "the position is in turns", position, {"unit": "turn"}),
        (
            "velocity_unit",
            "the position is in thousandths of the velocity's unit",
            position,
            {"scale": 0.001},
        ),
        ("velocity_sign", "position and velocity have opposite signs", velocity, {"sign": -1}),
    ]
    if abs(ratio) != 1.0 and np.isfinite(ratio):
        in_rpm = {**rotor, "unit": "rpm"}
        ways += [
            ("gear_side", "the velocity is that of the rotor", velocity, rotor),
            ("gear_side", "the position is that of the rotor", position, rotor),
            ("gear_side", "the velocity is that of the rotor, in rpm", velocity, in_rpm),
        ]
    for turn, worth in COUNTS_OF_A_TURN.items() if counted else ():
        ways.append(("counts", f"the position counts {turn} a turn", position, {"scale": worth}))
    yield from ((kind, text, {"columns": {name: entry}}) for kind, text, name, entry in ways)
    yield from (("time_unit", f"the time is in {u}", {"time": {"unit": u}}) for u in CLOCKS)


def velocity_ratio(mend: Mend) -> float:
    """Return velocity over d position / d time of a joint in a log that needs a mend of it."""
    rules = parse_column_map(mend)
    factors = {rule.target.rpartition(".")[2]: rule.factors[0] for rule in rules.rules}
    return factors.get("position", 1.0) / (factors.get("velocity", 1.0) * rules.time.factor)


def whole_counts(log: Log) -> list[str]:
    """Return the positions that hold encoder counts: whole numbers, far beyond turns."""
    names = [f"{joint}.position" for joint in log.with_quantity("position")]
    far = [name for name in names if np.ptp(log.column(name)) > _COUNTS]
    return [name for name in far if np.array_equal(log.column(name), np.round(log.column(name)))]


def wraps(log: Log) -> list[LogFinding]:
    """Return the positions that jump by their period, or by the bit that holds their sign."""
    found, degrees, holes = [], False, gaps(log.time)

    def add(name: str, text: str, entry: Mapping[str, Any], kind: str = "wrap") -> None:
        found.append(_suspected(kind, name, text, {"columns": {name: entry}}, 1.0))

    names = [n for n in log.names if n.endswith((".position", ".rotor_position"))]
    for name in names:
        values = log.column(name)
        if bit := _sign_bit(values):
            text = f"counts from {1 << bit} on mirror those below: bit {bit} is a sign."
            add(name, text, {"sign_bit": bit})
            continue
        rows, steps = jumps(values)
        # Where samples are missing a joint that moves on jumps without any wrap.
        sampled = ~np.isin(rows, holes)
        rows, sizes = rows[sampled], np.abs(steps[sampled])
        if not rows.size or np.ptp(sizes) > _SAME_JUMP * sizes.mean():
            continue
        turn = float(period(sizes.mean()))
        degrees |= turn == 360.0
        entry: dict[str, Any] = {"unwrap": turn or float(sizes.mean())}
        entry |= {"unit": "deg"} if turn == 360.0 else {}
        said = f"{rows.size} jumps of {sizes.mean():.6g} ({PERIODS.get(turn, _RESET)}), the first "
        add(name, f"{said}at row {int(rows[0]) + 1}.", entry)
        found[-1] = found[-1] if turn else replace(found[-1], mend={})
    left = {*names} - {finding.column for finding in found} if degrees else set()
    for name in sorted(n for n in left if n.endswith(".position")):
        if float(np.abs(log.column(name)).max()) > 2.0 * pi:
            text = "beyond a turn, beside positions that wrap at 360: in degrees, too."
            # The turn that is nearest to zero, as for the others.
            add(name, text, {"unit": "deg", "unwrap": 360.0}, "degrees")
    return found


def _sign_bit(values: FloatArray) -> int:
    """Return the number of the bit that is the sign of counts, 0 where none is.

    Below zero such counts begin again at 2^bit and grow with the distance from zero. Read so, they
    make no jump.
    """
    high = float(values.max())
    if high < 256.0 or values.min() < 0.0 or np.any(values != np.round(values)):
        return 0
    bit = int(log2(high))
    limit = float(1 << bit)
    above = values >= limit
    if not above.any() or above.all() or np.max(values[above]) - limit > 0.9 * limit:
        return 0
    steps = np.abs(np.diff(np.where(above, limit - values, values)))
    return bit if float(steps.max()) < 0.05 * limit else 0


def stale_rows(log: Log) -> list[LogFinding]:
    """Return what to do about rows in which every position is zero, though the joints are not.

    A second publisher on the same topic, or a message of a driver that starts, leaves them.
    """
    names = [f"{joint}.position" for joint in log.with_quantity("position")]
    moving = [name for name in names if np.ptp(log.column(name)) > 0.0]
    if not moving:
        return []
    values = np.stack([log.column(name) for name in moving], axis=1)
    zero = np.all(values == 0.0, axis=1)
    at, rest = np.flatnonzero(zero), np.flatnonzero(~zero)
    if not 0 < at.size < _STALE_SHARE * len(log):
        return []
    # A joint that passes or rests at zero comes from near there, and not at twice its speed.
    path = np.stack([np.interp(at, rest, column[rest]) for column in values.T], axis=1)
    steps = np.abs(np.diff(values[rest], axis=0)).max(axis=1)[np.diff(rest) == 1]
    if np.median(np.abs(path).max(axis=1)) <= 2.0 * np.quantile(steps, _FASTEST):
        return []
    mend = {"columns": {name: {"empty": 0.0, "missing": "drop_rows"} for name in moving}}
    text = (
        f"{at.size} of {len(log)} rows hold zero in {', '.join(moving)}, the first at row {at[0]}, "
        "though the joints are elsewhere before and after: no measurements, but those of a second "
        "publisher or of a driver that starts."
    )
    return [LogFinding("error", "stale", moving[0], text, "To drop them, " + say_so(mend), mend)]


def magnitudes(logs: Sequence[Log]) -> list[LogFinding]:
    """Return the refusal of torques that are magnitudes without a sign, for all logs together.

    Drives of one kind report alike: none of the torques is ever on the other side of zero, though
    they come down to it and rise again as steeply as they came.
    """
    names = reported(logs[0].columns if logs else ())
    held = {name: [log.column(name) for log in logs if log.has(name)] for name in names}
    known = {name: values for name, values in held.items() if any(map(np.any, values))}
    folds = mirrored([v for each in known.values() for v in each])
    if not folds:
        return []
    listed = ", ".join(known)
    out = {"columns": {name: False for name in known}}
    text = (
        f"{listed} {'is' if len(known) == 1 else 'are'} never below zero and mirrored there "
        f"{folds} times: a magnitude without sign, which is no torque."
    )
    way = (
        "Record the current or torque with its sign (servos keep it in a bit of its own). If the "
        "targets of the drives are recorded, they make the torque: state kp and kd in robot.toml, "
        f"map the targets, and {say_so(out, 'leave the magnitudes out')}"
    )
    return [LogFinding("error", "torque_magnitude", next(iter(known)), text, way)]


def mirrored(torques: Sequence[FloatArray]) -> int:
    """Return how often torques of one kind are mirrored at zero, 0 if they have a sign."""
    moved = [values for values in torques if np.any(values)]
    if any(values.min() < 0.0 < values.max() for values in moved):
        return 0
    folds = sum(_folds(np.abs(values)) for values in moved)
    one_side = len({bool(values.max() > 0.0) for values in moved}) == 1
    return folds if one_side and folds >= _FOLDS else 0


def _folds(values: FloatArray) -> int:
    """Return how often a channel comes down to zero and rises again as steeply."""
    width = _FOLD_ROWS
    if values.size < 10 * width:
        return 0
    low = values <= _NEAR_ZERO * float(np.quantile(values, 0.99))
    slope = (values[width:] - values[:-width]) / width
    steep = 0.5 * float(np.sqrt(np.mean(slope**2)))
    starts, ends = true_runs(low)
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


def motion_findings(log: Log, ratios: Mapping[str, float]) -> list[LogFinding]:
    """Return what position, velocity and clock of a log say about each other.

    Args:
        log: the log.
        ratios: gear ratio N of joints that one motor drives alone; may be empty.
    """
    shown: dict[tuple[str, str], list[tuple[Mend, str, float, float]]] = {}
    counted = whole_counts(log)
    for joint, fit in velocity_fits(log).items():
        scale = fit.scale
        if abs(fit.correlation) <= _CORRELATION:
            continue
        known = [*of_motion(joint, ratios.get(joint, 1.0), f"{joint}.position" in counted)]
        densities = [_log_density(scale, velocity_ratio(mend)) for _, _, mend in known]
        odds = np.array(densities) + EVERYWHERE
        odd = log_mixture(np.log(abs(scale)), _ODD)
        stands = np.logaddexp(_log_density(scale, 1.0), odd)
        best = int(np.argmax(odds))
        probability = float(np.exp(odds[best] - logsumexp([*odds, stands])))
        if probability >= LIKELY:
            kind, said, mend = known[best]
            shown.setdefault((kind, said), []).append((mend, joint, scale, probability))
    found = [_contradiction(kind, said, group) for (kind, said), group in shown.items()]
    probability, unit = slow_clock(log)
    if probability >= LIKELY and not any(f.kind == "time_unit" for f in found):
        text = (
            f"the time stamps are {log.sample_time:g} s apart, too far for the motion of a robot: "
            f"the time is in {unit}?"
        )
        found.append(_suspected("time_unit", "time", text, {"time": {"unit": unit}}, probability))
    return found


def _contradiction(
    kind: str, said: str, group: Sequence[tuple[Mend, str, float, float]]
) -> LogFinding:
    """Return what joints show whose velocity differs from the derivative in one way."""
    mends, joints, scales, probabilities = zip(*group, strict=True)
    mend = together(mends)
    columns = listed([f"'{joint}.velocity'" for joint in joints])
    text = (
        f"{columns} {'is' if len(group) == 1 else 'are'} "
        f"{listed([f'{scale:.4g}' for scale in scales])} times the derivative of the "
        f"position: {said}?"
    )
    column = next(iter(mend.get("columns", {"time": None})))
    return _suspected(kind, column, text, mend, together_likely(probabilities))


def _suspected(kind: str, column: str, text: str, mend: Mend, probability: float) -> LogFinding:
    way = "If so, " + say_so(mend)
    return LogFinding(severity(probability), kind, column, text, way, mend, probability)


def together_likely(probabilities: Sequence[float]) -> float:
    """Return the probability of one mistake that several joints show, each with its own.

    It was made once, so its prior counts once; what the joints show adds up.
    """
    shown = np.array([min(p, 1.0 - 1e-15) for p in probabilities])
    odds = np.sum(np.log(shown / (1.0 - shown)) - EVERYWHERE) + EVERYWHERE
    return float(1.0 / (1.0 + np.exp(-odds)))


def slow_clock(log: Log) -> tuple[float, str]:
    """Return the probability that the time stamps are no seconds, and the unit that they have.

    From their distance, the length of the log and the speed of its fastest joint. Each alone leaves
    it open: a controller may run at 5 kHz, a log may be long, and a joint may creep.
    """
    worth, speed = np.array([LOG_UNITS[unit][1] for unit in ("s", *CLOCKS)]), _fastest(log)
    step = (np.log(worth * log.sample_time) - _USUAL_STEP) / _STEP_SPREAD
    length = (np.log(worth * log.duration) - _USUAL_LENGTH) / _LENGTH_SPREAD
    fast = (np.log((speed or _USUAL_SPEED) / worth) - np.log(_USUAL_SPEED)) / _SPEED_SPREAD
    odds = -0.5 * (step**2 + length**2 + (fast**2 if speed else 0.0))
    odds[1:] += EVERYWHERE
    wrong = np.logaddexp.reduce(odds[1:])
    likely = CLOCKS[int(odds[1:].argmax())]
    return float(np.exp(wrong - np.logaddexp(odds[0], wrong))), likely


def _fastest(log: Log) -> float:
    """Return the highest speed of any joint between rows far apart: no noise, no resolution."""
    places = np.unique(np.linspace(0, len(log) - 1, _SPEED_ROWS).astype(int))
    steps = np.diff(log.time[places])
    moved = [
        np.abs(np.diff(log.column(f"{joint}.position")[places])) / steps
        for joint in log.with_quantity("position")
    ]
    return float(np.max(moved)) if moved and steps.size else 0.0


def _log_density(scale: float, factor: float) -> float:
    """Return the log density of a ratio if a factor is what makes it."""
    if scale * factor <= 0.0:
        return -np.inf
    return float(log_mixture(np.log(scale / factor), _RATIO_SPREADS))


def log_mixture(away: FloatArray, parts: Iterable[tuple[float, float]]) -> FloatArray:
    """Return the log density, up to a constant, of normal distributions about zero.

    Args:
        away: (...) where it is asked for.
        parts: share and standard deviation of each.
    """
    each = [np.log(share / s) - 0.5 * (away / s) ** 2 for share, s in parts]
    return np.asarray(np.logaddexp.reduce(each))  # SciPy's takes ten times as long for so few
