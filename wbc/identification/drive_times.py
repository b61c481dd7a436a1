"""How late drives follow their targets and see their velocities: estimated before any cause.

Where logs hold targets in place of torques, the drives' own times are a part of every torque. In
what is left unexplained, reported minus needed at the output of gear j,

    r_j = d w_j' - t kd_j a_j + b_j v_j + I_j a_j + friction, load and offset of the joint

with w the part of the torque that follows the target, d its delay, and t the time constant of the
velocity's filter. The two times are shared by all drives; a delay of its own, viscous friction b
and inertia I stand for them at each joint, at a price. All are chosen together, by

    sum over joints of  1/2 ||r_j - ...||^2 / variance_j  +  price * (numbers that are not zero)
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.effects.drive import ActuationDelay
from wbc.identification.model.intervals import DISTORTED
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.folds import ROWS_PER_SAMPLE, correlated_rows
from wbc.identification.records.not_judged import reported_torque
from wbc.identification.records.preparation import prepare
from wbc.identification.records.record import Record
from wbc.measurement import Log, derivative
from wbc.robot import Robot

_PRICE = 10.0  # [nats] for a time, and for what stands for it at one joint: name, place, number
_USUAL = 0.01, 0.005  # [s] usual size of a delay, of a filter
# Share of what the times explain (rms) that they may miss. On two arms of another simulator, with
# held targets and filtered velocities, rotor inertias of 1.5 and 5 % of it were left.
_MISSED = 0.05
_LATE, _VISCOUS, _INERTIA = 0, 2, 3  # of a joint's columns
_OWN = tuple(
    [*late, *few]
    for late in ([], [_LATE])
    for few in ([], [_VISCOUS], [_INERTIA], [_VISCOUS, _INERTIA])
)
"""What one joint may have in place of the shared times: a delay of its own, friction, inertia."""
# Drives of one machine are alike: a delay that one has alone costs twice. So a single drive that is
# late has the machine's delay.
_COSTS = tuple(_PRICE * (len(own) + (_LATE in own)) for own in _OWN)
_ROUNDS = 20
_LINEARISED = 2
_LONGEST = 4  # share of the shortest log over which residuals are correlated with themselves


def prepared_with_times(robot: Robot, logs: Sequence[Log]) -> tuple[Robot, tuple[Record, ...]]:
    """Return a robot whose drives have the times that logs of targets show, and its records.

    Drives that report a torque stay as they are, and so does a robot that states such a time.

    Args:
        robot: the robot that the user believes in.
        logs: made ready for it as its links alone, see `prepare` for errors.
    """
    records = prepare(robot.without_effects().lossless(), logs)
    followed = np.any([_follows(record) for record in records], axis=0)
    for _ in range(0 if _states_times(robot) or not followed.any() else _LINEARISED):
        delay, lag, braked = _times(records, followed)
        robot = robot.with_drive_times(
            target_delay=np.where(followed, delay, np.nan),
            velocity_lag=np.where(braked, lag, np.nan),
        )
        if not (delay or lag):
            break
        records = prepare(robot.without_effects().lossless(), logs)
    return robot, records


def about_drive_times(robot: Robot) -> list[str]:
    """Return one sentence about the times that logs show of the drives; none where there are none.

    Args:
        robot: with these times.
    """
    gears = robot.transmission
    late = 1e3 * np.nan_to_num(np.stack([gears.target_delay, gears.velocity_lag])).max(axis=1)
    if not late.any():
        return []
    return [
        f"The torques are made of targets. By these logs the drives follow them {late[0]:.1f} ms "
        f"late and filter their velocities with {late[1]:.1f} ms. The model holds that; where you "
        "know better, state target_delay and velocity_lag in robot.toml."
    ]


def missed_by_times(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return (2, m + b) mean squares that two times may leave of what they explain [N m squared].

    First what all drives miss alike. Then what each may miss by itself: it takes its target at an
    instant of its own between two samples of the log, and misses as large a share of that length.

    Args:
        robot: with times of its drives.
        records: of its links alone.
    """
    gears = robot.transmission
    missed = np.zeros((2, records[0].weight.shape[1]))
    followed = np.isfinite(gears.target_delay)
    if followed.any():
        times = np.nan_to_num(np.stack([gears.target_delay, gears.velocity_lag], axis=1))
        own: list[list[FloatArray]] = [[], []]
        for record in records:
            sample = np.outer(followed, (1.0 / record.rate, 0.0))
            columns = _columns(record)[:, :, :2]
            for parts, each in zip(own, (times, times + sample), strict=True):
                parts.append(np.sum(columns * each, axis=2))
        squares = [np.mean(np.concatenate(parts) ** 2, axis=0) for parts in own]
        missed[:, : gears.size] = _MISSED**2 * np.stack(squares)
    return missed


def _states_times(robot: Robot) -> bool:
    """Return whether a robot says how late any of its drives is."""
    gears = robot.transmission
    stated = np.isfinite(gears.target_delay) | np.isfinite(gears.velocity_lag)
    return bool(stated.any()) or any(e.name == ActuationDelay.name for e in robot.effects)


def _follows(record: Record) -> BoolArray:
    """Return (m,) whether the torque of a drive is made of a target."""
    feedback = record.motion.feedback_torque
    if feedback is None:
        return np.zeros(record.torque.shape[1], dtype=bool)
    return np.asarray(feedback.any(axis=0))


def _times(records: Sequence[Record], followed: BoolArray) -> tuple[float, float, BoolArray]:
    """Return delay and filter [s] that cost least, and which drives brake.

    Each joint has what costs least beside them.
    """
    gains = np.nan_to_num(records[0].robot.transmission.velocity_gain)
    braked = followed & (gains > 0.0)
    sums = _normal_equations(records, followed)
    chosen = [[], [0], *([[1], [0, 1]] if braked.any() else [])]
    each = [_descended(sums, start, free) for start, free in product(range(len(_OWN)), chosen)]
    _, times = min(each, key=lambda one: one[0])
    return float(times[0]), float(times[1]), braked


def _normal_equations(records: Sequence[Record], followed: BoolArray) -> list[list[FloatArray]]:
    """Return for every joint and choice of its own numbers (3, 3) squares.

    Squares of what is left, of the delay's and of the filter's column, over the variance, once all
    that the joint may have is taken out.
    """
    links = records[0].robot
    size = links.transmission.size
    left = [condensed_residual(links, [record])[:, :size] for record in records]
    columns = [_columns(record) for record in records]
    needed = [reported_torque(r)[:, :size] - own for r, own in zip(records, left, strict=True)]
    residual, column, need = map(np.concatenate, (left, columns, needed))
    gears = links.transmission
    for k, times in enumerate((gears.target_delay, gears.velocity_lag)):
        residual += np.nan_to_num(times) * column[:, :, k]
    column = np.concatenate(
        [column, need[..., None], (np.abs(need) * column[:, :, 4])[..., None]], axis=2
    )
    ends = np.cumsum([len(part) for part in left])[:-1]
    sums = []
    for k in np.flatnonzero(followed).tolist():
        free = _without(column[:, k, 4:], np.column_stack([residual[:, k], column[:, k, :4]]))
        rest = _without(free[:, 1:], free[:, :1])
        parts = np.split(rest, ends)
        alike = float(correlated_rows(parts, min(map(len, parts)) // _LONGEST, 0.0)[0])
        variance = np.mean(rest**2) + DISTORTED**2 * np.mean(free[:, 0] ** 2) + 1e-300
        scale = np.sqrt(variance * max(alike, ROWS_PER_SAMPLE))
        own = [_without(free[:, [1 + n for n in numbers]], free[:, :3]) for numbers in _OWN]
        sums.append([part.T @ part / scale**2 for part in own])
    return sums


def _columns(record: Record) -> FloatArray:
    """Return (rows, m, 6) condensed columns of the times, of friction, inertia and offset."""
    robot, motion = record.robot, record.motion
    gears = robot.transmission
    own = np.zeros_like(record.torque) if motion.feedback_torque is None else motion.feedback_torque
    late = derivative(record.torque - own, record.rate) * np.abs(gears.gear_ratio)
    velocity = motion.velocity[:, robot.actuated] @ gears.motor_from_joint.T
    acceleration = derivative(velocity, record.rate)
    braking = -np.nan_to_num(gears.velocity_gain) * acceleration
    each = (late, braking, velocity, acceleration, np.sign(velocity), np.ones_like(velocity))
    wide = np.zeros((*record.weight.shape, len(each)))
    wide[:, : gears.size] = np.stack(each, axis=2)
    return record.condense(wide)[:, : gears.size]


def _without(columns: FloatArray, values: FloatArray) -> FloatArray:
    """Return `values` (rows, k) without what columns (rows, n) explain of them."""
    size = np.sqrt(np.sum(columns**2, axis=0))
    columns = columns[:, size > 0.0] / size[size > 0.0]
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=1e-9)[0])


def _descended(
    sums: Sequence[Sequence[FloatArray]], start: int, free: Sequence[int]
) -> tuple[float, FloatArray]:
    """Return the cost [nats] and the times (2,) from one choice of the joints' own numbers on."""
    own, costs, times = [start] * len(sums), np.inf, np.zeros(2)
    usual = np.diag([0.0, _USUAL[0] ** -2, _USUAL[1] ** -2])
    for _ in range(_ROUNDS):
        gram = usual + sum(joint[k] for joint, k in zip(sums, own, strict=True))
        times = np.zeros(2)
        if free:
            rows = np.array(free) + 1
            times[free] = np.linalg.solve(gram[np.ix_(rows, rows)], gram[rows, 0])
        x = np.array([1.0, *-times])
        each = np.array(
            [
                [0.5 * x @ part @ x + cost for part, cost in zip(joint, _COSTS, strict=True)]
                for joint in sums
            ]
        )
        costs = float(each.min(axis=1).sum() + 0.5 * x @ usual @ x + _PRICE * len(free))
        if own == (own := each.argmin(axis=1).tolist()):
            break
    return costs, times
