"""Rows of a log that are not judged.

Joints that stand still in one log and move in another, samples near impacts, what torque sensors
behind gears leave of the links, and drives whose report has nothing to do with what they need.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray, frozen
from wbc.identification.records.filters import LOWEST, OF_RATE
from wbc.identification.records.record import (
    Record,
    at_outputs,
    left_by,
    output_count,
    output_names,
    output_units,
    rubbing,
)
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.tables import few

_BASE_MOVES = 5e-3  # [m, rad] between the 5 % and 95 % quantiles: more than a sensor's noise
_SEEN = 0.5  # of a row, below which it is named as hardly seen


def low_passed_torques(records: Sequence[Record]) -> Iterator[str]:
    """Yield a warning where a low-pass took the noise of torques away."""
    joints = np.array(records[0].robot.transmission.joints)
    passed = np.array([record.noise.passed for record in records])
    filtered = np.isfinite(passed).any(axis=0) & ~np.any([r.followed for r in records], axis=0)
    if filtered.any():
        named = "all joints" if filtered.all() else ", ".join(joints[filtered])
        most = np.nanmax(np.where(np.isfinite(passed), passed, np.nan)[:, filtered])
        yield (
            f"the torques of {named} hold nothing faster than {most:.2g} Hz: a low-pass took their "
            "noise away. The noise floor is what they hold there, which may be more than noise. "
            "Logs without the filter, or one motion recorded twice, would tell it."
        )


def slow_logs(logs: Sequence[Log], band: float) -> Iterator[str]:
    """Yield a warning where slow logs narrow the band of all.

    Args:
        logs: that are compared together.
        band: of what is judged [Hz].
    """
    labels = [log.source.label for log in logs if OF_RATE / log.sample_time < LOWEST]
    if labels:
        way = "" if len(labels) == len(logs) else f" Without {few(labels)} it would be wider."
        said = f"torques are compared below {band:.2g} Hz, a tenth of the slowest sampling rate."
        yield said + way


def unmeasured_forces(records: Sequence[Record], outputs: Sequence[str]) -> Iterator[str]:
    """Yield what is not seen where contacts touched whose forces no sensor measured.

    Args:
        records: the logs.
        outputs: (m + b,) names of the rows that a model is judged by.
    """
    balances = [record.balance for record in records]
    shares = [balance.seen_share for balance in balances if balance is not None]
    if not shares:
        return
    names = dict.fromkeys(n for r in records for n, touches in r.active.items() if touches.any())
    seen = np.mean(shares, axis=0)
    lost = [f"{n} {100.0 * s:.0f} %" for n, s in zip(outputs, seen, strict=True) if s < _SEEN]
    little = f". Little is left to judge of {', '.join(lost)}" if lost else ""
    yield (
        f"no force was measured at {', '.join(names)}: while it touches, its force is what the "
        f"balance of the base asks for, and what acts like such a force is not seen{little}. The "
        "mass of the robot and its balance show only in the motors' torques; a force sensor would "
        "tell them better. Probabilities are too high without it: of causes stated at 0.95 or more "
        "on generated robots, 85 % were there."
    )


def moving_bases(robot: Robot, logs: Sequence[Log]) -> Iterator[str]:
    """Yield a warning if the base moves in logs of a robot whose base is believed to be fixed.

    What a log calls `base`, or a joint whose name begins so, is its base.
    """
    found: dict[str, float] = {}
    labels = []
    for log in logs if not robot.floating_size else ():
        moves = _base_moves(robot, log)
        labels += [log.source.label] if moves else []
        found |= {owner: max(most, found.get(owner, 0.0)) for owner, most in moves.items()}
    if found:
        listed = ", ".join(f"{owner} by {distance:.2g}" for owner, distance in found.items())
        yield (
            f"{', '.join(labels)}: the base moves ({listed} m or rad), and that of '{robot.name}' "
            "is fixed: what its motion asks of the joints is taken for something else. Give the "
            "robot with its free base (`wbc list robots`), or hold the base while recording."
        )


def _base_moves(robot: Robot, log: Log) -> dict[str, float]:
    """Return how far [m, rad] the coordinates of the base move that the robot does not have."""
    moves: dict[str, float] = {}
    for name, values in log.columns.items():
        owner, _, quantity = name.partition(".")
        coordinate = name if owner == "base" else owner
        told = quantity.startswith(("position", "orientation")) and owner.startswith("base")
        distance = float(np.ptp(np.quantile(values, [0.05, 0.95]))) if told else 0.0
        if distance > _BASE_MOVES and coordinate not in robot.joints:
            moves[coordinate] = distance
    return moves


# Of its travel in the log in which it moves furthest. The joints of seven recorded sets travel at
# least 5 % of it in each of their logs; one that a drive holds against the others trembles by 0.01
# to 0.1 %.
_TREMBLES = 0.01
_HIDDEN = 1e-9  # share of a row that is seen, below which only rounding is left
_SHARE = 0.4  # of what the motion needs; a drive that reports less is not merely mis-scaled
_FOLLOWS = 0.7  # correlation with what the motion needs
_FLOORS = 20.0  # a report this far above its noise says something, whatever it is
# Standard deviations of the share, by which it must lie below `_SHARE`. The shares of the four
# drives of a recorded arm that report nothing are 0.01, 0.09, 0.02 and -0.04 +- 0.16; the least of
# the 31 others on eight recorded machines is 0.71 +- 0.06.
_DEVIATIONS = 2.0
_BLOCKS = 20  # of which what is left is taken to be independent
# Share of what friction leaves held out, that links of any inertia must explain of a report which
# follows them: 0.02, -0.28 and -1.40 of the three drives of a recorded arm that report nothing;
# 0.49, 0.52, 0.81 and 0.83 of reports of two arms whose drawing has guessed masses.
_EXPLAINED = 0.25
_FIFTHS = 5  # of the logs, held out one after the other


def not_judged_at_rest(records: Sequence[Record]) -> tuple[Record, ...]:
    """Return the records without weight where an output stands still that moves in another log.

    Friction at rest, or a brake, carries an unknown part of the load, so such rows say nothing
    that the logs with motion do not say better. An output that moves in no log keeps its weight:
    its load is all that is known of it.
    """
    pairs = zip(records, standing(records), strict=True)
    return tuple(replace(r, weight=frozen(r.weight * ~aside)) for r, aside in pairs)


def standing(records: Sequence[Record]) -> BoolArray:
    """Return (logs, outputs) whether an output stands still in a log and moves in another one."""
    robot = records[0].robot
    joints = [*robot.transmission.joints, *robot.passive_joints]
    columns = [robot.position_index(joint) for joint in joints]
    # More than its sensors' noise, and some of the way that it goes in another log.
    moving = np.stack([r.noise.moving(r.motion.velocity, r.bandwidth) for r in records])
    travel = np.stack([np.ptp(r.motion.position[:, columns], axis=0) for r in records])
    moving = moving[:, rubbing(robot)] & (travel > _TREMBLES * travel.max(axis=0))
    # A motor turns with each joint of which its own angle is made.
    size, made_of = robot.transmission.size, np.abs(robot.transmission.motor_from_joint) > 0.0
    moves = at_outputs(robot, moving[:, :size] @ made_of.T, moving[:, size:])
    return np.asarray(~moves & moves.any(axis=0))


def standing_joints(records: Sequence[Record]) -> Iterator[str]:
    """Yield a warning that names the joints that are not judged in some logs."""
    names = [record.name for record in records]
    each = zip(records[0].robot.transmission.joints, standing(records).T, strict=False)
    logs = {joint: [*compress(names, still)] for joint, still in each}
    found = [f"{joint} in {few(own)}" for joint, own in logs.items() if own]
    if found:
        yield (
            f"joints that stand still: {'; '.join(found)}. They are not judged there, because "
            "friction at rest or a brake carries an unknown part of their load."
        )


def sensed_joints(robot: Robot, logs: Sequence[Log]) -> tuple[str, ...]:
    """Return the driven joints with `<joint>.joint_torque` in all logs."""
    joints = robot.transmission.joints
    return tuple(j for j in joints if all(log.has(f"{j}.joint_torque") for log in logs))


def without_torque_sensors(robot: Robot, logs: Sequence[Log]) -> list[Log]:
    """Return the logs as drives alone tell them, where they tell anything.

    Args:
        robot: that the logs are held against.
        logs: as recorded.
    """
    joints = set(robot.transmission.joints) - set(robot.sensor_only)
    spared = {f"{joint}.joint_torque" for joint in joints}
    return [log.select(name for name in log.names if name not in spared) for log in logs]


def not_judged(records: Sequence[Record]) -> tuple[int, ...]:
    """Return the outputs that say nothing.

    Drives without a report, links that are not described, and a base that touches all the time at
    contacts without force sensors: their forces are what its balance asks for.
    """
    drives = np.flatnonzero(~np.all([record.reported for record in records], axis=0))
    shares = [r.balance.seen_share if r.balance is not None else np.inf for r in records]
    balanced = np.max(np.broadcast_arrays(*shares, np.zeros(1)), axis=0) < _HIDDEN
    carried = np.flatnonzero(balanced) if balanced.size > 1 else drives[:0]
    return (*map(int, drives), *map(int, carried), *without_links(records[0].robot))


def without_links(robot: Robot) -> tuple[int, ...]:
    """Return the outputs behind the sensors of joints that carry no mass.

    What stands there the robot does not describe, such as the other motor of a dynamometer.
    """
    first = output_count(robot) - len(robot.torque_sensors)
    data = robot.model.createData()
    pin.computeSubtreeMasses(robot.model, data)
    masses = [data.mass[robot.model.getJointId(joint)] for joint in robot.torque_sensors]
    return tuple(first + k for k, mass in enumerate(masses) if mass <= 0.0)


def told_outputs(records: Sequence[Record]) -> list[tuple[int, str, str]]:
    """Return number, name and unit of every output that an answer tells of.

    Not of drives without a report, where sensors behind their gears report.
    """
    robot = records[0].robot
    pairs = enumerate(zip(output_names(robot), output_units(robot), strict=True))
    reported = np.any([record.reported for record in records], axis=0)
    unknown = {*np.flatnonzero(~reported).tolist(), *without_links(robot)}
    return [(k, *pair) for k, pair in pairs if k not in unknown]


def silent_drives(
    records: Sequence[Record], residuals: Sequence[FloatArray], floor: FloatArray
) -> tuple[str, ...]:
    """Return the driven joints whose report is close to its noise and does not hold their need.

    Beside friction and an offset, which any joint may have, the report holds a share of what the
    motion needs. A drive that tells the truth has a share of 1, one with a wrong torque constant
    0.5 to 2, one that reports noise 0. Its size alone does not tell: on a recorded arm the current
    of a light wrist is noise as large as what the wrist needs. Nor does its share where masses are
    guessed: links of other inertias must not explain the report either. Nothing can be learnt about
    such a joint: any drive model that scales its report to nothing would explain it.

    Args:
        records: the logs.
        residuals: (rows, m + b) condensed residual of each: reported minus needed.
        floor: (m + b,) noise floor of the outputs.
    """
    robot = records[0].robot
    size = robot.transmission.size
    reported = np.concatenate([reported_torque(record)[:, :size] for record in records])
    needed = reported - np.concatenate(list(residuals))[:, :size]
    turns, friction = robot.transmission.motor_from_joint, []
    for record in records:  # speed and direction of every gear, as the residual is condensed
        speed = record.motion.velocity[:, robot.actuated] @ turns.T
        friction.append(np.stack([record.condense(x) for x in (speed, np.sign(speed))]))
    rubs, silent = np.concatenate(friction, axis=1), records[0].reported.copy()
    for k in np.flatnonzero(silent):
        given, columns = reported[:, k], np.column_stack([needed[:, k], *rubs[:, :, k]])
        given, columns = given - given.mean(), columns - columns.mean(axis=0)
        share, deviation = _share(given, columns)
        sizes = np.linalg.norm(given) * np.linalg.norm(columns[:, 0])
        silent[k] = (
            abs(share) + _DEVIATIONS * deviation < _SHARE
            and abs(given @ columns[:, 0]) < _FOLLOWS * max(float(sizes), 1e-300)
            and given.std() < _FLOORS * floor[k]
            and not _follows_other_links(records, int(k), given, columns[:, 1:])
        )
    return tuple(n for n, yes in zip(robot.transmission.joints, silent, strict=True) if yes)


def _follows_other_links(
    records: Sequence[Record], gear: int, given: FloatArray, friction: FloatArray
) -> bool:
    """Whether links with any inertias explain what friction leaves of a report (rows,)."""
    robot = records[0].robot
    direction = np.zeros(robot.model.nv)
    direction[robot.actuated] = robot.transmission.topology[:, gear]
    offset = [record.condense(np.ones_like(record.torque))[:, gear] for record in records]
    rubs = np.column_stack([np.concatenate(offset), friction])
    links = np.concatenate([record.condensed_regressor(gear, direction) for record in records])
    alone, beside = _held_out(given, rubs), _held_out(given, np.hstack([rubs, links]))
    return beside < (1.0 - _EXPLAINED) * alone


def _held_out(given: FloatArray, columns: FloatArray) -> float:
    """Return the squares that columns (rows, k) leave where they were not fitted."""
    left = 0.0
    for held in np.array_split(np.arange(len(given)), _FIFTHS):
        _, taken = left_by(np.delete(columns, held, axis=0), np.delete(given, held))
        left += float(np.sum((given[held] - columns[held] @ taken) ** 2))
    return left


def _share(given: FloatArray, columns: FloatArray) -> tuple[float, float]:
    """Return how much of the first column a report holds beside the others.

    Args:
        given: (rows,) the report.
        columns: (rows, k) what the motion needs, then what friction would be.

    Returns:
        The share and its standard deviation by blocks of rows. Of a need that never changes the
        share is unknown.
    """
    size = np.sqrt(np.sum(columns**2, axis=0))
    if size[0] <= 0.0:
        return 0.0, np.inf
    scaled = columns[:, size > 0.0] / size[size > 0.0]
    inverse = np.linalg.pinv(scaled.T @ scaled)
    solution = inverse @ (scaled.T @ given)
    left = given - scaled @ solution
    blocks = np.array_split(scaled * left[:, None], min(_BLOCKS, len(left)))
    sums = np.array([block.sum(axis=0) for block in blocks]) @ inverse[:, 0]
    return float(solution[0] / size[0]), float(np.linalg.norm(sums) / size[0])


def reported_torque(record: Record) -> FloatArray:
    """Return the condensed torque (rows, m + b) that the drives report, at the motor output."""
    torque = record.torque * np.abs(record.robot.transmission.gear_ratio)
    base = np.zeros((len(torque), record.robot.floating_size))
    return record.condense(np.concatenate([torque, base, record.sensed], axis=1))
