"""How late drives follow their targets and see their velocities: estimated before any cause.

Where logs hold targets in place of torques, the drives' own times are a part of every torque. In
what is left unexplained, reported minus needed at the output of gear j,

    r_j = d w_j' + s u_j' - t kd_j a_j + b_j v_j + I_j a_j + friction, load and offset of the joint

with u the torque and s its delay, w the part of it that follows the target and d by how much more
that is late, and t the time constant of the velocity's filter. The three times are shared by all
drives; a delay of its own, viscous friction b and inertia I stand for them at each joint, at a
price. The ten numbers of one link that is not as drawn are shared, too. All are chosen together, by

    sum over joints of  1/2 ||r_j - ...||^2 / variance_j  +  price * (own numbers of the joint)
        +  1/2 log det (information of the logs and of what is usual about s and t, over the latter)

Nothing is early, and no friction gives power. Drives whose torque is late do: -kp v is in u'.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.dynamics import inertial_parameters
from wbc.effects.drive import ActuationDelay, RotorInertia
from wbc.effects.friction import RotorViscousFriction, ViscousFriction
from wbc.identification.model.columns import inertial_columns
from wbc.identification.model.fit import beside_others, scaled
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.not_judged import reported_torque
from wbc.identification.records.preparation import prepare
from wbc.identification.records.record import (
    Record,
    by_log,
    correlated_rows,
    left_by,
    rows_per_sample,
)
from wbc.measurement import Log, derivative
from wbc.measurement.filters import turned
from wbc.measurement.schema import REPORTED
from wbc.robot import Effect, Robot
from wbc.transmission import DRIVE_TIMES

_PRICE = 10.0  # [nats] for what stands for a time at one joint: name, place, number
_USUAL = 0.01, 0.01, 0.005  # [s] usual size of the two delays, of a filter
_TIMES = len(DRIVE_TIMES)
# Share of what the times explain (rms) that they may miss. On two arms of another simulator, with
# held targets and filtered velocities, rotor inertias of 1.5 and 5 % of it were left.
MISSED = 0.05
# They may be what the shared times of drives are, and stay out where these are estimated anew.
STAND_INS = (ActuationDelay, RotorInertia, ViscousFriction, RotorViscousFriction)
_LATE, _WHOLE, _LAG, _VISCOUS, _INERTIA, _DRY = range(6)  # of a joint's columns
# What one joint may have in place of the shared times: a delay of its own, friction, inertia.
_OWN = tuple(
    (*late, *few)
    for late in ((), (_LATE,))
    for few in ((), (_VISCOUS,), (_INERTIA,), (_VISCOUS, _INERTIA))
)
# Drives of one machine are alike: what one has alone costs twice. So one of several drives that is
# late has the machine's delay, and the only drive of a machine has times at twice the price.
_COSTS = tuple(_PRICE * (len(own) + (_LATE in own)) for own in _OWN)
_ROUNDS = 20
# For the ten numbers of a link. On 18 sets of logs of another simulator a payload is worth 910 nats
# or more, a link that is as drawn 232 or less; where one is taken in vain the times stay.
_LINK = 10.0 * _PRICE
AGREEING = 3  # joints that agree on a delay: two may by chance
# Logs are made ready anew with each estimate, until it repeats. After two rounds the delay of an
# arm of another simulator was off by .11 of 6.36 ms, which made a fourth of what was left; each
# round more leaves a third of that.
_LINEARISED = 8
_REPEATS = 3e-3  # share of the times by which an estimate may differ from the last


def prepared_with_times(
    robot: Robot, logs: Sequence[Log], found: Sequence[Effect] = ()
) -> tuple[Robot, tuple[Record, ...], bool]:
    """Return a robot whose drives have the times that logs of targets show, and its records.

    Last comes whether the times repeat where they are estimated anew.

    Drives that report a torque stay as they are, and so does a robot that states such a time. A
    late target is, to first order, friction at every joint in proportion to its gain: which of the
    two it is shows only where the times repeat. So both are followed there.

    Args:
        robot: the robot that the user believes in.
        logs: made ready for it as its links alone, see `prepare` for errors.
        found: causes beside the times, if any are known. Of one that changes one link the ten
            numbers of that link are free: they were fitted beside other times.
    """
    records = prepare(robot.without_effects().lossless(), logs)
    followed = np.any([record.followed for record in records], axis=0)
    if _states_times(robot) or not followed.any():
        return robot, records, True
    has = np.tile(followed[:, None], (1, _TIMES))
    has[:, _LAG] &= np.nan_to_num(robot.transmission.velocity_gain) > 0.0
    several = [[k for k in range(_TIMES) if n >> k & 1] for n in range(2**_TIMES)]
    chosen = [free for free in several if has[:, free].any(axis=0).all()]
    ways = [[free for free in chosen if (_LATE in free) == late] for late in (False, True)]
    known, loaded = _acting(robot, found)

    def repeated(
        robot: Robot, records: tuple[Record, ...], way: Sequence[Sequence[int]], loaded: list[int]
    ) -> tuple[float, Robot, tuple[Record, ...], bool]:
        """Return the cost of times [nats], the robot with them, its records, and if they repeat."""
        times = np.zeros(_TIMES)
        for _ in range(_LINEARISED):
            before = times
            squares, _ = _normal_equations(records, followed, loaded, known)
            cost, times = _cheapest(*squares, way)
            target, seen, lag = np.where(has, times, np.nan).T
            each = target + seen, seen, lag
            robot = robot.with_drive_times(dict(zip(DRIVE_TIMES, each, strict=True)))
            step = np.max(np.abs(times - before)) / np.max(times) if times.any() else 0.0
            if step <= _REPEATS:
                break
            records = prepare(robot.without_effects().lossless(), logs)
        return cost, robot, records, bool(step <= MISSED)

    ends = [repeated(robot, records, way, loaded) for way in ways]
    (_, robot, records, settled), way = min(zip(ends, ways, strict=True), key=lambda end: end[0][0])
    if found or not (loaded := _loaded(records, followed, way)):
        return robot, records, settled
    return repeated(robot, records, way, loaded)[1:]


def _acting(robot: Robot, found: Sequence[Effect]) -> tuple[list[Effect], list[int]]:
    """Return those causes that act as they were found, and the links that others change."""
    acting, links = [], set[int]()
    for effect in found:
        change = inertial_parameters(effect.change(robot)) - inertial_parameters(robot)
        changed = np.flatnonzero(change.reshape(-1, 10).any(axis=1)).tolist()
        if len(changed) == 1:
            links.update(changed)
        else:
            acting.append(effect)
    return acting, sorted(links)


def differing_times(
    given: Robot, robot: Robot, logs: Sequence[Log], found: Sequence[Effect]
) -> tuple[Robot, tuple[Record, ...]] | None:
    """Return a robot with the times that logs show beside causes, and its records.

    None where the times stay.

    Before anything was found, other causes moved them: beside a lossy gear and a heavy link of an
    arm the filter of its velocities was twice as long, and a rotor inertia at each joint made up
    for that.

    Args:
        given: the robot as the user describes it.
        robot: with the times that were estimated without these causes.
        logs: as above.
        found: the causes.
    """
    if _states_times(given) or not np.any(_times_of(robot)):
        return None
    other, records, settled = prepared_with_times(given, logs, found)
    before, after = _times_of(robot), _times_of(other)
    moved = np.max(np.abs(after - before)) > MISSED * np.max(before)
    return (other, records) if settled and moved else None


def _loaded(
    records: Sequence[Record], followed: BoolArray, chosen: Sequence[Sequence[int]]
) -> list[int]:
    """Return the link that is likely not to be as drawn, none where the drawing does.

    What a tool needs is to a part the derivative of torques and of positions: left out, a payload
    of 1.4 kg moved the times of an arm's drives by half of them, and rotor inertias of all joints
    stood for that.
    """
    each = [[], *([k] for k in range(len(records[0].robot.model.inertias) - 1))]
    costs = []
    for links in each:
        squares, level = _normal_equations(records, followed, links, ())
        costs.append(level + _cheapest(*squares, chosen)[0] + _LINK * len(links))
    return each[int(np.argmin(costs))]


def _of_links(records: Sequence[Record], links: Sequence[int]) -> FloatArray:
    """Return (rows, m + b, 10 n) what the numbers of n links add to the condensed residual."""
    robot = records[0].robot
    if not links:  # most logs need no regressor of the links here, which takes long
        return np.zeros((sum(record.rows for record in records), records[0].weight.shape[1], 0))
    places = np.add.outer(10 * np.array(links), np.arange(10)).ravel()
    own = np.eye(10 * (len(robot.model.inertias) - 1))[:, places]
    return inertial_columns(robot, records, [None] * len(records), own)


def on_time(
    robot: Robot, logs: Sequence[Log], known: Sequence[Effect] = ()
) -> tuple[list[Log], float]:
    """Return logs without the delay that all reported torques share, and that delay [s].

    A bus or another clock makes them late, all alike, and the moment at which drives sample makes
    them early or late. On a sound arm, simulated, 5 ms were a drag at each of four joints. A delay
    of one joint is a cause, and one with which the robot misses more is none. What a supply lacks
    follows the motion, too: on two arms of another simulator it was taken for a delay, and delays
    at all joints took that back.

    Args:
        robot: the robot that the user believes in.
        logs: of it.
        known: causes beside the delay, if any are known.
    """
    links, lag, moved = robot.without_effects().lossless(), 0.0, list(logs)
    delays = [effect.where for effect in robot.effects if effect.name == ActuationDelay.name]
    left: list[FloatArray] = []
    for _ in range(_LINEARISED):
        records = prepare(links, moved)
        told = np.all([record.reported for record in records], axis=0)
        told &= ~np.any([record.followed for record in records], axis=0)
        told &= ~np.isin(robot.transmission.joints, delays)
        if np.count_nonzero(told) < AGREEING:
            return list(logs), 0.0
        missed = condensed_residual(links.with_effects(*known), records)
        left.append(np.mean(missed[:, : told.size][:, told] ** 2, axis=0) + 1e-300)
        squares, _ = _normal_equations(records, told, (), known)
        alone, together = (_cheapest(*squares, [free], -np.inf) for free in ([], [_WHOLE]))
        if not lag and alone[0] <= together[0]:
            return list(logs), 0.0
        more = -float(together[1][_WHOLE])
        if lag and abs(more) <= _REPEATS * abs(lag):
            break
        lag += more
        moved = [turned(log, _torques(log), lag) for log in logs]
    if np.sum(np.log(left[-1] / left[0])) >= 0.0:
        return list(logs), 0.0
    return moved, lag


def about_lag(lag: float) -> list[str]:
    """Return one sentence about the delay of all torques [s] that was taken out; none without."""
    side = "behind" if lag > 0.0 else "ahead of"
    told = f"All torques are {1e3 * abs(lag):.1f} ms {side} the motion. That is taken out."
    return [told] if lag else []


def _torques(log: Log) -> list[str]:
    names = [name for name in log.columns if name.rpartition(".")[2] in (*REPORTED, "joint_torque")]
    return [name for name in names if np.isfinite(log.column(name)).all()]


def about_drive_times(robot: Robot) -> list[str]:
    """Return one sentence about the times that logs show of the drives; none where there are none.

    Args:
        robot: with these times.
    """
    each = [getattr(robot.transmission, name) for name in DRIVE_TIMES]
    late = 1e3 * np.nan_to_num(each).max(axis=1)
    if not late.any():
        return []
    return [
        f"The torques are made of targets. By these logs the drives follow them {late[0]:.1f} ms "
        f"late, see their own motion {late[1]:.1f} ms late and filter their velocities with "
        f"{late[2]:.1f} ms. The model holds that; where you know better, state target_delay, "
        "feedback_delay and velocity_lag in robot.toml."
    ]


def missed_by_times(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return (m + b,) mean squares that the times may leave of what they explain [N m squared].

    Args:
        robot: with times of its drives.
        records: of its links alone.
    """
    made = _made(robot, records)
    made[:, : robot.transmission.size] *= _times_of(robot)
    return np.asarray(MISSED**2 * np.mean(np.sum(made, axis=2) ** 2, axis=0))


def made_by_own_times(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return (m + b, rows, 3) what each drive's own times make of its output, one deviation [N m].

    They differ from those of all by as large a share as these may miss, and by as large a share of
    a sample: a drive takes its target and looks at its motion between two of them.

    Args:
        robot, records: as above.
    """
    made = MISSED * _made(robot, records)
    made[:, : robot.transmission.size] *= _times_of(robot) + 1.0 / records[0].rate
    return np.moveaxis(made, 1, 0)


def _made(robot: Robot, records: Sequence[Record]) -> FloatArray:
    """Return (rows, m + b, 3) what a second more of each time makes; zero without a target."""
    made = np.zeros((sum(record.rows for record in records), records[0].weight.shape[1], _TIMES))
    followed = np.isfinite(robot.transmission.target_delay)
    if followed.any():
        each = np.concatenate([_columns(record)[:, :, :_TIMES] for record in records])
        made[:, : followed.size] = each * followed[:, None]
    return made


def _times_of(robot: Robot) -> FloatArray:
    """Return the times (m, 3) [s] of the drives of a robot, 0 where unknown."""
    target, seen, lag = (np.nan_to_num(getattr(robot.transmission, k)) for k in DRIVE_TIMES)
    return np.stack([target - seen, seen, lag], axis=1)


def _states_times(robot: Robot) -> bool:
    """Return whether a robot says how late any of its drives is."""
    stated = any(np.isfinite(getattr(robot.transmission, name)).any() for name in DRIVE_TIMES)
    return stated or any(e.name == ActuationDelay.name for e in robot.effects)


def _cheapest(
    sums: FloatArray, friction: FloatArray, chosen: Sequence[Sequence[int]], least: float = 0.0
) -> tuple[float, FloatArray]:
    """Return the least cost [nats] and the times (3,) [s]; each joint has what costs least.

    No time is below `least`. The search begins with the same numbers at all joints, and with one
    joint that has none.
    """
    joints = np.arange(len(sums))
    alike = [np.full(joints.shape, k) for k in range(len(_OWN))]
    alone = [np.where(joints == k, 0, _OWN.index((_VISCOUS, _INERTIA))) for k in joints]
    starts = [(own, free) for own in (*alike, *alone) for free in chosen]
    each = [_descended(sums, friction, *start, least) for start in starts]
    return min(each, key=lambda one: one[0])


def _normal_equations(
    records: Sequence[Record], followed: BoolArray, loaded: Sequence[int], known: Sequence[Effect]
) -> tuple[tuple[FloatArray, FloatArray], float]:
    """Return what every joint leaves with every choice of its own numbers.

    Args:
        records: of the links alone.
        followed: (m,) the joints.
        loaded: links that need not be as drawn, with n numbers together.
        known: causes that act.

    Returns:
        (joints, choices, 4 + n, 4 + n) squares of what is left and of the columns that all joints
        share, those of the times and of the links, over the variance, once all that the joint may
        have is taken out; what remains beside all of them and its numbers counts for none. And
        (joints, choices, 4 + n) the viscous friction that each of these takes. Then half the
        logarithms of the variances, times samples [nats].
    """
    robot, links = records[0].robot.with_effects(*known), _of_links(records, loaded)
    size = robot.transmission.size
    residual = condensed_residual(robot, records)[:, :size]
    need = np.concatenate([reported_torque(r) for r in records])[:, :size] - residual
    column = np.concatenate([_columns(record) for record in records])
    for k, times in enumerate(_times_of(robot).T):
        residual += times * column[:, :, k]
    column = np.concatenate([column, need[..., None]], axis=2)
    sums, friction, level = [], [], 0.0
    shared = 1 + _TIMES + links.shape[2]
    for k in np.flatnonzero(followed).tolist():
        every = [residual[:, k], column[:, k, :_TIMES], links[:, k], column[:, k, _TIMES:_DRY]]
        free, _ = left_by(column[:, k, _DRY:], np.column_stack(every))
        rest, _ = left_by(free[:, 1:], free[:, :1])
        alike = float(correlated_rows(by_log(records, rest), 0.0)[0])
        variance = np.mean(rest**2) + MISSED**2 * np.mean(free[:, 0] ** 2) + 1e-300
        scale = np.sqrt(variance * max(alike, rows_per_sample(records)))
        level += 0.5 * len(rest) * variance / scale**2 * np.log(variance)
        for numbers in _OWN:
            places = [1 + n if n < _TIMES else n - _DRY for n in numbers]
            own, taken = left_by(free[:, places], free[:, :shared])
            own[:, 0] -= rest[:, 0]  # at right angles to all else
            sums.append(own.T @ own / scale**2)
            rubs = _VISCOUS in numbers
            friction.append(taken[numbers.index(_VISCOUS)] if rubs else np.zeros(shared))
    shape = -1, len(_OWN), shared
    return (np.reshape(sums, (*shape, shared)), np.reshape(friction, shape)), float(level)


def _columns(record: Record) -> FloatArray:
    """Return (rows, m, 11) condensed columns of the times, friction, inertia, load and offset.

    What a gear loses is a share of what its links need: what the rotor needs does not pass it.
    Friction that builds up after a reversal is late by itself: on a generated arm it stood for a
    delay of 54 ms that all torques share, and six delays stood for what that took out.
    """
    from wbc.mechanics.series import memories  # it loads the compiler

    robot, motion = record.robot, record.motion
    gears = robot.transmission
    own = np.zeros_like(record.torque) if motion.feedback_torque is None else motion.feedback_torque
    parts = record.torque - own, record.torque
    late, whole = (derivative(part, record.rate) * np.abs(gears.gear_ratio) for part in parts)
    velocity = motion.velocity[:, robot.actuated] @ gears.motor_from_joint.T
    acceleration = derivative(velocity, record.rate)
    braking = -np.nan_to_num(gears.velocity_gain) * acceleration
    angle = motion.position[:, robot.actuated_position] @ gears.motor_from_joint.T
    load, side = record.load[:, robot.actuated] @ gears.topology, np.sign(velocity)
    dry = side, *memories(angle), np.ones_like(velocity), np.abs(load) * side
    return record.condense(np.stack([late, whole, braking, velocity, acceleration, *dry], axis=2))


def _descended(
    sums: FloatArray, friction: FloatArray, own: IntArray, free: Sequence[int], least: float
) -> tuple[float, FloatArray]:
    """Return the cost [nats] and the times (3,) from one choice of the joints' own numbers on.

    Infinite where a target, the torque or a velocity is late by less than `least`.
    """
    usual = np.diag([0.0, *np.power(_USUAL, -2.0), *np.zeros(sums.shape[2] - 1 - _TIMES)])
    cost, found = np.inf, np.zeros(len(usual) - 1)
    rows = np.array([*free, *range(_TIMES, len(found))], dtype=np.int_) + 1
    # A time costs by how much narrower the logs make it, beside what links need. Where in a sample
    # a target acts is known of no machine, and no finding: that costs nothing. A lone drive shows
    # that no better than friction, and its times cost twice.
    lone, joints = len(sums) == 1, np.arange(len(sums))
    paid = [1 + k for k in free if k != _LATE or lone]
    counted = [*paid, *range(1 + _TIMES, len(usual))]
    told = (usual + sums[:, 0].sum(axis=0))[np.ix_(counted, counted)]
    told = beside_others(told, range(len(paid)))
    price = 0.5 * (1 + lone) * (np.linalg.slogdet(told)[1] - np.sum(np.log(np.diag(usual)[paid])))
    for _ in range(_ROUNDS):
        gram = usual + sums[joints, own].sum(axis=0)
        alike, size = scaled(gram[np.ix_(rows, rows)])  # some columns may repeat others
        found[rows - 1] = np.linalg.solve(alike, gram[rows, 0] / size) / size
        x = np.array([1.0, *-found])
        each = 0.5 * np.einsum("i,jcik,k->jc", x, sums, x) + _COSTS
        each[friction @ x < 0.0] = np.inf
        cost = float(each.min(axis=1).sum() + 0.5 * x @ usual @ x + price)
        if np.array_equal(own, own := each.argmin(axis=1)):
            break
    times = found[:_TIMES]
    # A target is late by the sum of two: it may act before the drive sees its own motion.
    lowest = np.array([least - max(times[_WHOLE], least), least, least])
    return (cost if np.all(times >= lowest) else np.inf), np.maximum(times, lowest)
