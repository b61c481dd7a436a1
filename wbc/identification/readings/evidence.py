"""How well what drives report agrees with what a motion needs: evidence, lags and zeros.

The report of joint k, at the output of its motor, is modelled as

    r = g (n + kappa |n| sgn v) + c a + f_v v + f_c sgn v + offset + error,

with n what the links need, v and a speed and acceleration of the motor. Physics fixes the signs:
g, kappa, f_v, f_c > 0 and 0 <= c <= a few times the joint's inertia; g is near one. Signs, sides
and units are thus told by what no drive, friction or payload imitates.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from math import inf, pi
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import nnls

from wbc.arrays import FloatArray, IntArray
from wbc.identification.readings.kinds import LINKS, Reading, Turn
from wbc.identification.readings.log_rows import BEHIND_GEARS, LogRows, Need
from wbc.identification.records.record import rms
from wbc.measurement.column_map import ColumnRule, parse_column_map
from wbc.robot.coordinates import slides

_log_sum = np.logaddexp.reduce  # that of SciPy takes ten times as long for so few numbers

GAIN_SPREAD = float(np.log(4.0)) / 2.0
"""Standard deviation of ln g. A judgement: drives, losses and loads amount to less than a factor 4
in 95 of 100 machines."""

_STRANGE = float(np.log(0.002))  # a large report that follows something else: a judgement
_EITHER_WAY = -4.0 * float(np.log(2.0))  # four coefficients of either sign: half of the odds each
# Beyond these gains a report is likelier to follow something else than to have so rare a gain.
_FARTHEST = float(np.sqrt(-2.0 * (_STRANGE + _EITHER_WAY)))
# The narrowest likelihood, of 40 samples that only `_PHYSICS` blurs, is half as high .023 away.
_NARROWEST = 0.046
_COUNT = 2 * int(_FARTHEST * GAIN_SPREAD / _NARROWEST) + 1
GAINS = np.exp(np.linspace(-_FARTHEST, _FARTHEST, _COUNT) * GAIN_SPREAD)
GAIN_PRIOR = -0.5 * (np.log(GAINS) / GAIN_SPREAD) ** 2
GAIN_PRIOR -= _log_sum(GAIN_PRIOR)
# Standard deviation of ln of a gain where nothing is wrong: root mean square .036 of 32 joints of
# twelve recorded and generated machines whose gains are known to .05.
SAME_GAIN = -0.5 * (np.log(GAINS) / 0.036) ** 2
SAME_GAIN -= _log_sum(SAME_GAIN)
_RATIOS = np.exp(np.linspace(-2.5, 2.5, 101))
_RATIO_PRIOR = -0.5 * np.log(_RATIOS) ** 2  # ratios of robots' gears differ by e or so
_RATIO_PRIOR -= _log_sum(_RATIO_PRIOR)
_ROTOR_SPREAD = 0.4  # standard deviation of ln of a rotor's inertia over that of its data sheet ...
_ROTOR_WRONG = float(np.log(0.02))  # ... unless it is simply wrong
_ALIKE = 0.15  # standard deviation of ln g between drives of one kind
_NEAR = np.exp(-0.5 * (np.log(GAINS[:, None] / GAINS) / _ALIKE) ** 2)
_NEAR /= _NEAR.sum(axis=1, keepdims=True)
UNRELATED = float(np.log(0.1))  # a drive that carried nothing: a judgement, TIAGo has three
_USUAL = np.abs(np.log(GAINS)) < 3.0 * GAIN_SPREAD  # a factor of eight
_CAUSES = 5  # offset, speed, direction, loss under load, acceleration
_IDLE = 0.1  # share of the need below which a report may well be that of an idle drive
# Times the need: friction of 113 true reports of nine recorded machines is not above it; one
# more, of the shaft of a bare motor, has 2500 times the need.
_MOST, _BARE = 20.0, float(np.log(0.01))
# Share of a report's power below which it does not matter what rigid bodies and friction leave: of
# 2114 true reports of generated robots with hidden causes 92 % leave less, half of them 0.1 %.
_PHYSICS = 0.015
_LOST = 0.8  # share that a report leaves which does not follow; of those 2114 reports ...
_FOLLOWS = 0.3  # share that a report leaves from which its column follows nothing
_RARELY_LOST = 0.02  # ... no more than these leave more than 0.13, and each joint on its own
MOST_SAMPLES = 40.0  # beyond them errors of the model repeat themselves
ROUNDING = 1e-9  # of the largest cause, below which one is nothing: a joint that carries no load
_INERTIA = 3.0  # times a joint's own inertia that a forgotten rotor may have
_PARTS = 3  # of a log: what strays far in one counts once, and one joint alone is late in each


class Report(NamedTuple):
    """What a report says, for each gain: one joint, one way to read the columns.

    Attributes:
        gains: (G,) log likelihood at each gain of the grid.
        ratios: (F,) log likelihood at each factor of the grid by which the gear ratio may be
            another, where the inertia of the rotor is known.
        causes: (R, 5) what offset, speed, direction, load and acceleration add, over the report's
            size.
        target: (R,) the report in the same coordinates, over its size.
        left: share of the report's power that is left at the likeliest gain.
        idle: log likelihood, with its prior, of a drive that carried nothing in this log.
        samples: independent samples that count; 0 of a report that tells nothing.
        size: root of the sum of squares of the report about its mean [N m].
        heavy: log likelihood, at usual gains, of a rotor that nobody described and that may be any
            times heavier than its link; such a rotor accuses nobody and frees from being foreign.
        rubs: log likelihood of a report that is so many times as large as what the joint needs,
            unless the joint carries next to nothing, such as the shaft of a bare motor.
    """

    gains: FloatArray
    ratios: FloatArray
    causes: FloatArray
    target: FloatArray
    left: float = 1.0
    idle: float = 0.0
    samples: float = 0.0
    size: float = 0.0
    heavy: float = 0.0
    rubs: float = 0.0


_SILENT = Report(np.zeros(GAINS.size), np.zeros(_RATIOS.size), np.zeros((1, _CAUSES)), np.zeros(1))


def report(rows: LogRows, need: Need, joint: int, reported: FloatArray, samples: float) -> Report:
    """Return how a report agrees with a need.

    Args:
        rows: tell inertias, and which quantity the drive reports.
        need: of all joints.
        joint: which of them.
        reported: (N,) torque at the output of the motor [N m].
        samples: independent samples that the report amounts to.
    """
    size = float(np.sqrt(np.sum((reported - reported.mean()) ** 2)))
    if size <= 0.0 or samples <= 0.0:
        return _SILENT
    causes, drawn = need_columns(need, joint)
    table = np.column_stack([causes, drawn, reported / size])
    reduced: FloatArray = np.asarray(np.linalg.qr(table, mode="r"))
    # The offset is free, so that its row is met, whatever the others are.
    others, change, needed, told = np.split(reduced[1:, 1:], [3, 4, 5], axis=1)
    gains, count = GAINS / size, min(samples, MOST_SAMPLES)
    rotor = float(rows.robot.transmission.reflected_inertia[joint])  # 0 where it is not known
    free, found = _nonnegative(np.hstack([others, change]), told - gains * needed)
    inertia = np.minimum(found[-1], _INERTIA * float(rows.inertia[joint]) / size)
    # A factor of the gear ratio changes what is measured on the rotor, not torque behind it.
    power = 0.0 if rows.torques[joint].endswith(BEHIND_GEARS) else -1.0
    asked = np.concatenate([gains, gains, _RATIOS**power / size])
    inertias = np.concatenate([inertia, rotor * gains, rotor * _RATIOS ** (power + 2.0) / size])
    left, _ = _nonnegative(others, told - asked * needed - inertias * change)
    bounded, held, ratios = np.split(left, [GAINS.size, 2 * GAINS.size])
    bounded = np.where(inertia < found[-1], bounded, free)
    likely, heavy = log_likelihood(bounded, count), -inf
    if rotor > 0.0:
        away = np.log(np.maximum(inertia / (gains * rotor), 1e-300)) / _ROTOR_SPREAD
        likely = likely + np.maximum(-0.5 * away**2, _ROTOR_WRONG)
        likely = np.maximum(likely, log_likelihood(held, count))
    else:
        heavy = float(_log_sum((GAIN_PRIOR + log_likelihood(free, count))[_USUAL]))
    own, target = reduced[:, :-2] / size, reduced[:, -1]
    idle = _EITHER_WAY + float(log_likelihood(_free_misfits([own], [target]), count)[0])
    likeliest = float(bounded[np.argmax(likely)])
    rubs = -0.5 * _excess(size, need.whole[:, joint], _MOST) ** 2
    idle += UNRELATED - 0.5 * _excess(size, need.whole[:, joint], _IDLE) ** 2
    told = log_likelihood(ratios, count)
    return Report(likely, told, own, target, likeliest, idle, count, size, heavy, rubs)


def ratio_evidence(reports: Sequence[Sequence[Report]]) -> tuple[float, float, float]:
    """Return (log evidence of one factor on all gear ratios, of none, the likeliest factor).

    The gear ratio shows twice: in what is measured on the rotor, and in the rotor's reflected
    inertia. A torque constant, a payload or a rotor that is wrong shows once. No gain is free here,
    with a factor or without one: free gains of twelve joints cost more than a factor does.

    Args:
        reports: per log, of all joints.
    """
    total = np.sum([one.ratios for log in reports for one in log], axis=0)
    none = float(np.interp(0.0, np.log(_RATIOS), total))
    return float(_log_sum(_RATIO_PRIOR + total)), none, float(_RATIOS[int(np.argmax(total))])


def log_evidence(logs: Sequence[Sequence[Report]]) -> float:
    """Return the log evidence of the reports of all joints in all logs.

    The gain of a joint is the same in all logs. Gains are drawn apart or alike (one kind of drive,
    one unit), with equal odds. In a log a drive may have carried nothing; and a joint may have
    something else than the need in its reports, which is then so in all logs.

    Args:
        logs: per log, the reports of all joints, read in one way.
    """
    total, strange = at_gains(logs)
    apart = float(np.sum(np.logaddexp(_log_sum(GAIN_PRIOR + total, axis=1), strange)))
    highest = total.max(axis=1, keepdims=True)
    near = np.log(np.maximum(np.exp(total - highest) @ _NEAR.T, 1e-300)) + highest
    given = np.logaddexp(near, strange[:, None])
    alike = float(_log_sum(GAIN_PRIOR + given.sum(axis=0)))
    return float(np.logaddexp(apart, alike) - np.log(2.0))


def foreign(logs: Sequence[Sequence[Report]]) -> FloatArray:
    """Return (m,) the probability that no report of a joint follows what the links need.

    That is what neither an idle drive explains nor the need with a gain that machines have; or all
    reports that tell something, where none of them follows its need in any log: those of another
    robot, or of another run.
    """
    total, strange = at_gains(logs)
    tells = np.any([[one.samples > 0.0 for one in reports] for reports in logs], axis=0)
    left = np.min([[one.left for one in reports] for reports in logs], axis=0)[tells]
    if np.all(left > _LOST):
        odds = _STRANGE - left.size * float(np.log(_RARELY_LOST))
        return np.where(tells, 1.0 / (1.0 + np.exp(-odds)), 0.0)
    whole = np.logaddexp(_log_sum(GAIN_PRIOR + total, axis=1), strange)
    heavy = np.sum([[one.heavy for one in reports] for reports in logs], axis=0)
    usual = np.logaddexp(_log_sum((GAIN_PRIOR + total)[:, _USUAL], axis=1), heavy)
    return np.asarray(np.maximum(-np.expm1(usual - np.logaddexp(whole, heavy)), 0.0))


def at_gains(logs: Sequence[Sequence[Report]]) -> tuple[FloatArray, FloatArray]:
    """Return the log likelihood of all logs at each gain of each joint (m, G), and without (m,)."""
    total = sum(np.logaddexp([one.gains for one in r], [[one.idle] for one in r]) for r in logs)
    rubs = np.sum([[one.rubs for one in reports] for reports in logs], axis=0)
    total = total + np.logaddexp(rubs, _BARE)[:, None]
    strange = []
    for reports in zip(*logs, strict=True):
        # Speed, direction, load and acceleration may go either way, but the same in all logs.
        left = _free_misfits([one.causes for one in reports], [one.target for one in reports])
        samples = np.array([one.samples for one in reports])
        strange.append(_STRANGE + (_EITHER_WAY + float(np.sum(log_likelihood(left, samples)))))
    return np.asarray(total), np.array(strange)


def _free_misfits(causes: Sequence[FloatArray], targets: Sequence[FloatArray]) -> FloatArray:
    """Return the share of each report's power that causes of either sign leave."""
    whole, target = np.concatenate(causes), np.concatenate(targets)
    left = target - whole @ np.linalg.lstsq(whole, target, rcond=ROUNDING)[0]
    ends = np.cumsum([len(one) for one in targets])[:-1]
    return np.array([float(part @ part) for part in np.split(left, ends)])


def _excess(size: float, need: FloatArray, most: float) -> float:
    """Return by how many standard deviations a report is larger than so many times the need."""
    share = size / max(float(np.std(need)) * np.sqrt(need.size), 1e-300)
    return max(0.0, float(np.log(share / most))) / GAIN_SPREAD


def need_columns(need: Need, joint: int) -> tuple[FloatArray, FloatArray]:
    """Return (N, 5): offset, speed, direction, loss under load, acceleration; and the need (N,)."""
    speed = need.speed[:, joint]
    links = need.links[:, joint]
    # A direction is no sharper than the filter that the speed has gone through.
    way = np.tanh(speed / max(0.1 * float(np.std(speed)), 1e-12))
    causes = [np.ones(speed.size), speed, way, np.abs(links) * way, need.change[:, joint]]
    return np.column_stack(causes), links


def log_likelihood(left: FloatArray, count: FloatArray | float) -> FloatArray:
    """Return the log likelihood of independent samples of which a share of the power is left."""
    return np.asarray(-0.5 * count * np.log(left + _PHYSICS))


def _nonnegative(columns: FloatArray, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what few columns (R, n) leave of targets (R, G), and coefficients, none below zero.

    Few columns have few subsets: the best coefficients are the least squares of one of them.

    Returns:
        (G,) squares that are left, and (n, G) coefficients.
    """
    used = np.array([*product((0.0, 1.0), repeat=columns.shape[1])])[:, None]
    subsets = columns * used
    found = (np.linalg.pinv(subsets, rcond=ROUNDING) * used.swapaxes(1, 2)) @ targets
    left = np.sum((targets - subsets @ found) ** 2, axis=1)
    left[(found < 0.0).any(axis=1)] = np.inf
    best, each = np.argmin(left, axis=0), np.arange(targets.shape[1])
    return left[best, each], found[best, :, each].T


class Judged(NamedTuple):
    """A reading of logs, and what it makes of the reports.

    Attributes:
        reading: the way to read them.
        reports: of each log, those of the driven joints, (m,).
        strays: of each log, (parts, m) how far the reports stray from the need in thirds of it:
            power of the difference over the geometric mean of the powers of both. Nothing is
            fitted, so no gain, friction or inertia can take the place of what the links need.
    """

    reading: Reading
    reports: tuple[tuple[Report, ...], ...]
    strays: tuple[FloatArray, ...]

    @property
    def logs(self) -> tuple[int, ...]:
        """Numbers of the logs that are read so."""
        return self.reading.logs or tuple(range(len(self.reports)))

    def score(self, as_is: Judged, logs: Sequence[int]) -> float:
        """Return the weight of this reading of some logs, none if it brings no report closer."""
        right = self.reading.kind == LINKS or self.closer(as_is, logs)
        return self.weight(as_is, logs) if right else -inf

    def weight(self, as_is: Judged, logs: Sequence[int]) -> float:
        """Return the log of prior times evidence if some logs are read so, others as they stand."""
        each = [(self if k in logs else as_is).reports[k] for k in range(len(self.reports))]
        return self.reading.prior + log_evidence(each)

    def explained(self, as_is: Judged, logs: Sequence[int]) -> FloatArray:
        """Return (2, m) the share of each joint's power that is explained before and after."""
        each = [[one.reports[k] for k in logs] for one in (as_is, self)]
        sizes, left = (
            np.array([[[getattr(r, name) for r in reports] for reports in one] for one in each])
            for name in ("size", "left")
        )
        return np.average(np.maximum(1.0 - left, 0.0), axis=1, weights=sizes**2 + 1e-300)

    def closer(self, as_is: Judged, logs: Sequence[int]) -> bool:
        """Whether this reading brings reports closer to the need.

        A correction that does not, explains the reports by its gain and friction, and not by the
        links. Nor is one true that explains less than before. Joints have errors of their own
        size: a report of friction alone strays a hundred times as far as one that follows its need,
        and does not outweigh it.
        """
        farther, (now, then) = 0.0, self.explained(as_is, logs)
        for k, j in product(logs, range(now.size)):
            one, other = (read.reports[k][j] for read in (as_is, self))
            # What follows no need, read in either way, strays as chance has it.
            if one is not other and min(one.left, other.left) < _FOLLOWS:
                farther += float(np.log(self.strays[k][:, j] / as_is.strays[k][:, j]).sum())
        return farther < 0.0 and bool(then.sum() >= now.sum())


class Bench:
    """Holds logs against their robot; each need and each report is computed once."""

    def __init__(self, rows: Sequence[LogRows], shares: Sequence[float]) -> None:
        """Judge the logs as they stand.

        Args:
            rows: of each log.
            shares: of its samples that count: a run that is repeated n times says the nth part.
        """
        self.rows, self._shares = rows, shares
        self._needs: dict[tuple[Any, ...], Need] = {}
        self._reports: dict[tuple[Any, ...], Report] = {}
        self._idle: dict[tuple[int, int], float] = {}
        self.as_is = self.judged(Reading())

    def judged(self, reading: Reading) -> Judged:
        """Return what a reading makes of the reports of all driven joints in all logs."""
        logs = range(len(self.rows))
        own = reading.logs or logs
        each = [self._of_log(k, reading if k in own else Reading()) for k in logs]
        return Judged(reading, *zip(*each, strict=True))

    def _of_log(self, log: int, reading: Reading) -> tuple[tuple[Report, ...], FloatArray]:
        rows = self.rows[log]
        rules = parse_column_map(reading.mend).rules
        moved = linear([f"{joint}.position" for joint in rows.robot.single_joints], rules)[:3]
        sources, factor, _, lag = linear(rows.torques, rules)
        place = (log, *(part.tobytes() for part in moved), reading.described)
        if place not in self._needs:
            self._needs[place] = rows.need(*moved, reading.described)
        need = self._needs[place]
        torque = (rows.late(lag) if lag.any() else rows.torque)[:, sources]
        torque = torque * (factor * rows.conversion / rows.conversion[sources])
        reports = []
        for k, source in enumerate(map(int, sources)):
            key = (place, k, torque[:, k].tobytes())
            if key not in self._reports:
                count = self._shares[log] * float(rows.samples[source])
                told = report(rows, need, k, torque[:, k], count)
                # What means nothing does so however it is read.
                idle = self._idle.setdefault((log, source), told.idle)
                self._reports[key] = told._replace(idle=idle)
            reports.append(self._reports[key])
        size = np.maximum(rms(torque) * rms(need.whole), 1e-300)
        strays = [rms(part) ** 2 for part in np.array_split(torque - need.whole, _PARTS)]
        for k in reading.behind:
            reports[k] = self.as_is.reports[log][k]
        return tuple(reports), np.array(strays) / size


def linear(
    names: Sequence[str], rules: Iterable[ColumnRule]
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Return what rules make of some columns, (n,) each: source, factor, offset and lag [s].

    Args:
        names: of the columns, in a log that the rules read; others are passed over.
        rules: of a column map.
    """
    order, factor = np.arange(len(names)), np.ones(len(names))
    offset, lag = np.zeros((2, len(names)))
    for rule in rules:
        if rule.target in names:
            k = names.index(rule.target)
            order[k], factor[k] = names.index(rule.sources[0]), rule.factors[0]
            offset[k], lag[k] = rule.offset, rule.lag
    return order, factor, offset, lag


_SHIFTS = 3  # times that torques are moved back; delays of 10 to 50 ms end within 5 ms
# Share by which the lags of a robot's torques may differ between joints and logs. Delays and
# filters of 10 to 50 ms in an arm's torques differ by .05 to .2 (standard deviation over mean);
# what losses with memory, wrong links and noise of 14 recorded and generated machines look like, by
# .3 to 20.
_ALIKE_LAGS = 0.25
_LONGEST = 0.15  # [s] of a bus or a filter
_SHOWN = 3.0  # standard errors from which a lag is one
_LEAST_LAGS = 3  # that agree: two of torques without meaning do so by chance
# Times what the torques of the other joints seem to be late, from which one alone is: 4.5 and more
# where one of a generated arm is late by 20 to 50 ms, at most 3.0 on nineteen right machines.
_APART = 3.5

# Offsets of a position, a degree apart, and the log prior of each: half of the zeros that people
# move are quarters of a turn, one of which is as rare as another unit of a column.
_ZEROS = np.radians((np.arange(360) + 180) % 360 - 180)
_MOVED = np.full(360, float(np.log(0.018 / (2.0 * 356.0))))
_MOVED[::90] = float(np.log(0.018 / 6.0))
_MOVED[0] = 0.0
# Odds of links that are not as drawn to a zero that is another: a judgement.
_NOT_DRAWN = -float(np.log(3.0))
_DRAWN_OFF = 0.3  # [rad] by which a drawing or a loose encoder may be off; beyond it a column is


def shared_lags(logs: Sequence[LogRows], least: float) -> list[tuple[list[int], float]]:
    """Return the joints whose torques are late, and by how much [s]: all of them, or some alone.

    Bus and filter are the same for all joints and rows, or for one joint in all rows; what else
    looks like a lag is another one at each.

    Args:
        logs: of one robot, at least one.
        least: lag that counts [s]: within a sample it is a matter of when a drive samples.
    """
    still = np.any([np.ptp(rows.torque, axis=0) == 0.0 for rows in logs], axis=0)
    moving = np.flatnonzero(~still).tolist()
    if len(moving) < 2:
        return []
    if lag := _agreed(logs, moving, least, 1):
        return [(moving, lag)]
    sizes = np.array([np.mean(_lags(logs, [k], 0.0, _PARTS)[0] ** 2) for k in moving])
    others = np.sqrt((sizes.sum() - sizes) / (len(moving) - 1))
    alone = [([k], _agreed(logs, [k], least, _PARTS)) for k in moving]
    return [one for one, other in zip(alone, others, strict=True) if one[1] > _APART * other]


def _agreed(logs: Sequence[LogRows], joints: Sequence[int], least: float, parts: int) -> float:
    """Return the lag [s] that joints share in every part of the logs, 0 where they do not."""
    lag = 0.0
    for _ in range(_SHIFTS):
        lags, errors = _lags(logs, joints, lag, parts)
        # A report that follows no need tells no lag; none tells more than lags are alike.
        weights = (1.0 / np.hypot(errors, _ALIKE_LAGS * np.median(lags))) ** 2
        whole = float(weights.sum())
        lag = float(weights @ lags) / whole
        count = whole**2 / float(weights @ weights)
        if not least < lag < _LONGEST or count < _LEAST_LAGS or lag < _SHOWN / np.sqrt(whole):
            return 0.0
    return lag if float(weights @ (lags - lag) ** 2) < lags.size else 0.0


def _lags(
    logs: Sequence[LogRows], joints: Sequence[int], lag: float, parts: int
) -> tuple[FloatArray, FloatArray]:
    """Return by how much torques of joints are late [s] in each part of logs, and standard errors.

    A late torque is r(t) = f(t - tau), so r is what the motion makes and -tau r', with r moved back
    by a first guess of the lag.
    """
    told = []
    for rows in logs:
        step, need = 1.0 / rows.rate, rows.as_is
        before, reported, after = (rows.late(t) for t in (lag - step, lag, lag + step))
        fall = (before - after) / (2.0 * step)
        # Errors of the model repeat themselves: only independent samples count, if any.
        samples = np.clip(rows.samples, 1e-12, MOST_SAMPLES)
        for k in joints:
            causes = need_columns(need, k)[0][:, 1:]
            table = np.column_stack([causes, need.whole[:, k], fall[:, k], reported[:, k]])
            told += [_slope(part, float(samples[k])) for part in np.array_split(table, parts)]
    more, errors = np.array(told).T
    return lag + more, errors


def _slope(table: FloatArray, samples: float) -> FloatArray:
    """Return (2,) the factor of the last but one column in the last, of either sign, and its error.

    The factors of the columns before are not below zero, and the offset is free.
    """
    table = table - table.mean(axis=0)
    size = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    causes, told = (table / size)[:, :-1], (table / size)[:, -1]
    found, left = nnls(np.column_stack([causes, -causes[:, -1]]), told)
    error = left / np.sqrt(samples) * np.linalg.norm(np.linalg.pinv(causes, rcond=ROUNDING)[-1])
    return np.array([found[-2] - found[-1], error]) * float(size[-1] / size[-2])


def turns(logs: Sequence[LogRows]) -> list[Turn]:
    """Return turns about joints with which reports follow the need better.

    A zero that is another shows in all reports, a link that is not as drawn in none behind it.
    A link's need is a sum of two harmonics of each angle, so five needs tell it at all angles.

    Args:
        logs: of one robot, at least one.

    Returns:
        Of each joint the links that it moves, and its zero in all logs, which leaves to the
        diagnosis what is less than a drawing may be off by, and in every log in which it is another
        one than in all.
    """
    found: dict[tuple[int, int, tuple[int, ...] | None], tuple[float, tuple[int, ...]]] = {}
    robot, model, every = logs[0].robot, logs[0].robot.model, tuple(range(len(logs)))
    for i, joint in enumerate(robot.single_joints if logs[0].weighs else ()):
        if slides(robot, joint):
            continue
        names = [model.names[k] for k in model.subtrees[model.getJointId(joint)]][1:]
        behind = tuple(k for k, name in enumerate(robot.transmission.joints) if name in names)
        each = np.array([_on_circle(rows, i) for rows in logs])
        turned, prior, stands = _likeliest(np.delete(each, behind, axis=1).sum(axis=(0, 1)))
        if stands:
            found[i, turned, behind] = prior + _NOT_DRAWN, every
        shared, prior, stands = _likeliest(each.sum(axis=(0, 1)))
        if stands and abs(_ZEROS[shared]) > _DRAWN_OFF:
            found[i, shared, None] = prior, every
        for k, one in enumerate(each.sum(axis=1) if len(logs) > 1 else ()):
            own, prior, _ = _likeliest(one)
            if one[own] + prior > one[stands]:
                prior, having = found.get((i, own, None), (prior, ()))
                found[i, own, None] = prior, tuple(sorted({*having, k}))
    return [(i, float(_ZEROS[n]), *told, behind) for (i, n, behind), told in found.items()]


def _likeliest(at: FloatArray) -> tuple[int, float, int]:
    """Return another zero, its log prior, and the likeliest zero of all, by number.

    Which degree it is costs no more than the logs tell: the prior is that of all zeros that they
    allow beside the likeliest.

    Args:
        at: (360,) log likelihood.
    """
    odds = at + _MOVED
    other = int(np.argmax(odds[1:])) + 1
    prior = float(_log_sum(odds[1:]) - at[other])
    return other, prior, other if at[other] + prior > at[0] else 0


def _on_circle(rows: LogRows, single: int) -> FloatArray:
    """Return (m, 360) how likely reports are at offsets of a position, friction beside it."""
    turns = np.arange(5) * (2.0 * pi / 5.0)
    joints = np.arange(len(rows.robot.single_joints))
    needs = [rows.need(offset=np.where(joints == single, turn, 0.0)) for turn in turns]
    waves = np.column_stack([np.ones(5), *(f(n * turns) for n in (1, 2) for f in (np.cos, np.sin))])
    links = np.tensordot(np.linalg.inv(waves), np.array([need.links for need in needs]), axes=1)
    at = np.column_stack([np.ones(360), *(f(n * _ZEROS) for n in (1, 2) for f in (np.cos, np.sin))])
    found = []
    for k, reported in enumerate(rows.torque.T):
        causes = np.delete(need_columns(needs[0], k)[0], 3, axis=1)  # a load depends on the zero
        beside = np.linalg.qr(causes / np.maximum(np.linalg.norm(causes, axis=0), 1e-300))[0]
        table = np.column_stack([reported, links[:, :, k].T])
        table -= beside @ (beside.T @ table)
        power, pull = table[:, 0] @ table[:, 0], at @ (table[:, 0] @ table[:, 1:])
        inner = table[:, 1:].T @ table[:, 1:]
        size = np.maximum(np.einsum("di,ij,dj->d", at, inner, at), 1e-300)
        gain = np.maximum(pull / size, GAINS[0])
        left = np.maximum([power - (2.0 * pull - gain * size) * gain, 0.0 * gain + power], 0.0)
        share = left / max(float(np.sum((reported - reported.mean()) ** 2)), 1e-300)
        follows, idle = log_likelihood(share, min(float(rows.samples[k]), MOST_SAMPLES))
        follows -= 0.5 * (np.log(gain) / GAIN_SPREAD) ** 2
        found.append(np.maximum(follows, idle + UNRELATED))
    return np.array(found)
