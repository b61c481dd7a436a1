"""Lags of torques and zeros of positions: numbers that the logs themselves tell."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import TypeAlias

import numpy as np
from scipy.optimize import nnls
from scipy.special import logsumexp

from wbc.arrays import FloatArray, IntArray
from wbc.identification.readings.evidence import (
    GAIN_SPREAD,
    GAINS,
    MOST_SAMPLES,
    ROUNDING,
    UNRELATED,
    log_likelihood,
    need_columns,
)
from wbc.identification.readings.log_rows import LogRows, Need
from wbc.robot.coordinates import slides

_SHIFTS = 3  # times that torques are moved back; delays of 10 to 50 ms end within 5 ms
# Share by which the lags of a robot's torques may differ between joints and logs. Delays and
# filters of 10 to 50 ms in an arm's torques differ by .05 to .2 (standard deviation over mean);
# what losses with memory, wrong links and noise of 14 recorded and generated machines look like, by
# .3 to 20.
_ALIKE_LAGS = 0.25
_LONGEST = 0.15  # [s] of a bus or a filter
_SHOWN = 3.0  # standard errors from which a lag is one
_LEAST_LAGS = 3  # that agree: two of torques without meaning do so by chance
_PARTS = 3  # of a log, in each of which one joint alone must be as late
# Times what the torques of the other joints seem to be late, from which one alone is: 4.5 and more
# where one of a generated arm is late by 20 to 50 ms, at most 3.0 on nineteen right machines.
_APART = 3.5

# Offsets of a position, a degree apart, and the log prior of each: half of the zeros that people
# move are quarters of a turn, one of which is as rare as another unit of a column.
_ZEROS = np.radians((np.arange(360) + 180) % 360 - 180)
_MOVED = np.full(360, float(np.log(0.018 / (2.0 * 356.0))))
_MOVED[::90] = float(np.log(0.018 / 6.0))
_MOVED[0] = 0.0
_DRAWN_OFF = 0.3  # [rad] by which a drawing or a loose encoder may be off; beyond it a column is


def shared_lags(logs: Sequence[LogRows], least: float) -> list[tuple[list[int], float]]:
    """Return the joints whose torques are late, and by how much [s]: all of them, or some alone.

    A late torque is r(t) = f(t - tau), so r + tau r' is what the motion makes. Bus and filter are
    the same for all joints and rows, or for one joint in all rows; what else looks like a lag is
    another one at each.

    Args:
        logs: of one robot.
        least: lag that counts [s]: within a sample it is a matter of when a drive samples.
    """
    asked = [(rows, rows.need()) for rows in logs]
    driven = range(asked[0][0].torque.shape[1] if asked else 0)
    moving = [k for k in driven if all(np.ptp(rows.torque[:, k]) > 0.0 for rows in logs)]
    if len(moving) < 2:
        return []
    lag = _agreed(asked, moving, least, 1)
    if lag:
        return [(moving, lag)]
    sizes = np.array([np.mean(_lags(asked, [k], 0.0, _PARTS)[0] ** 2) for k in moving])
    others = np.sqrt((sizes.sum() - sizes) / (len(moving) - 1))
    alone = [([k], _agreed(asked, [k], least, _PARTS)) for k in moving]
    return [one for one, other in zip(alone, others, strict=True) if one[1] > _APART * other]


Asked: TypeAlias = Sequence[tuple[LogRows, Need]]


def _agreed(asked: Asked, joints: Sequence[int], least: float, parts: int) -> float:
    """Return the lag [s] that joints share in every part of the logs, 0 where they do not."""
    lag = 0.0
    for _ in range(_SHIFTS):
        lags, errors = _lags(asked, joints, lag, parts)
        usual = float(np.median(lags))
        # A report that follows no need tells no lag; none tells more than lags are alike.
        weights = (1.0 / np.hypot(errors, _ALIKE_LAGS * usual)) ** 2
        whole = float(weights.sum())
        lag = float(weights @ lags) / whole
        count = whole**2 / float(weights @ weights)
        if not least < lag < _LONGEST or count < _LEAST_LAGS or lag < _SHOWN / np.sqrt(whole):
            return 0.0
    return lag if float(weights @ (lags - lag) ** 2) < lags.size else 0.0


def _lags(
    asked: Asked, joints: Sequence[int], lag: float, parts: int
) -> tuple[FloatArray, FloatArray]:
    """Return by how much the torques of joints are late [s] in each part, and standard errors.

    Near a first guess of it.
    """
    told = [
        _lag(rows, need, lag, k, part)
        for rows, need in asked
        for k in joints
        for part in np.array_split(np.arange(len(need.speed)), parts)
    ]
    more, errors = np.array(told).T
    return lag + more, errors


def _lag(rows: LogRows, need: Need, lag: float, joint: int, part: IntArray) -> tuple[float, float]:
    """Return by how much more than `lag` a torque is late [s] in some rows, and its error."""
    step = 1.0 / rows.rate
    before, reported, after = (rows.late(t)[part, joint] for t in (lag - step, lag, lag + step))
    slope = (after - before) / (2.0 * step)
    causes, drawn = need_columns(need, joint)
    drawn = drawn + rows.robot.transmission.reflected_inertia[joint] * need.change[:, joint]
    causes, drawn = causes[part], drawn[part]
    table = np.column_stack([causes, drawn, -causes[:, 0], -slope, slope])
    size = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    scaled, rest = nnls(table / size, reported)
    found = scaled / size
    # A report that tells nothing has none.
    samples = min(max(float(rows.samples[joint]), 1e-12), MOST_SAMPLES)
    others = table[:, :-2] / size[:-2]
    alone = slope - others @ np.linalg.lstsq(others, slope, rcond=ROUNDING)[0]
    # Errors of the model repeat themselves: only independent samples count.
    error = rest / np.sqrt(samples) / max(float(np.linalg.norm(alone)), 1e-300)
    return float(found[-2] - found[-1]), error


def other_zeros(logs: Sequence[LogRows]) -> list[tuple[int, float, float, tuple[int, ...]]]:
    """Return the zeros of positions with which reports follow the need better.

    A link's need is a sum of two harmonics of each angle, so five needs tell it at all angles.

    Args:
        logs: of one robot, at least one.

    Returns:
        (single joint, offset of its position [rad], log prior, logs): one for all logs together,
        which leaves to the diagnosis what is less than a drawing may be off by; and for every log
        in which the joint's zero is another one than in all.
    """
    found: list[tuple[int, float, float, tuple[int, ...]]] = []
    every = tuple(range(len(logs)))
    robot = logs[0].robot
    for i, joint in enumerate(robot.single_joints if logs[0].weighs else ()):
        if slides(robot, joint):
            continue
        each = np.array([_on_circle(rows, i) for rows in logs])
        whole = each.sum(axis=0)
        shared, prior, stands = _likeliest(whole)
        if stands and abs(_ZEROS[shared]) > _DRAWN_OFF:
            found.append((i, float(_ZEROS[shared]), prior, every))
        for k, one in enumerate(each if len(logs) > 1 else ()):
            own, prior, _ = _likeliest(one)
            if one[own] + prior > one[stands]:
                found.append((i, float(_ZEROS[own]), prior, (k,)))
    return found


def _likeliest(at: FloatArray) -> tuple[int, float, int]:
    """Return another zero, its log prior, and the likeliest zero of all, by number.

    Which degree it is costs no more than the logs tell: the prior is that of all zeros that they
    allow beside the likeliest.

    Args:
        at: (360,) log likelihood.
    """
    odds = at + _MOVED
    other = int(np.argmax(odds[1:])) + 1
    prior = float(logsumexp(odds[1:]) - at[other])
    return other, prior, other if at[other] + prior > at[0] else 0


def _on_circle(rows: LogRows, single: int) -> FloatArray:
    """Return (360,) how likely the reports are at each offset of a position, friction beside it."""
    turns = np.arange(5) * (2.0 * pi / 5.0)
    joints = np.arange(len(rows.robot.single_joints))
    needs = [rows.need(offset=np.where(joints == single, turn, 0.0)) for turn in turns]
    waves = np.column_stack([np.ones(5), *(f(n * turns) for n in (1, 2) for f in (np.cos, np.sin))])
    links = np.tensordot(np.linalg.inv(waves), np.array([need.links for need in needs]), axes=1)
    at = np.column_stack([np.ones(360), *(f(n * _ZEROS) for n in (1, 2) for f in (np.cos, np.sin))])
    total = np.zeros(360)
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
        total += np.maximum(follows, idle + UNRELATED)
    return total
