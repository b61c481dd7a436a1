"""Joints that stand still in some logs and move in others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray, frozen
from wbc.identification.records.outputs import output_gear, output_row
from wbc.identification.records.record import Record
from wbc.robot import Robot

# Of its travel in the log in which it moves furthest. The joints of seven recorded sets travel at
# least 5 % of it in each of their logs; one that a drive holds against the others trembles by 0.01
# to 0.1 %.
_TREMBLES = 0.01
_NAMED = 3  # logs of a joint that a message names


def rubbing(robot: Robot) -> IntArray:
    """Return the rows in v of the joints that can rub: the driven ones, then the passive ones."""
    passive = [robot.velocity_index(joint) for joint in robot.passive_joints]
    return np.concatenate([robot.actuated, np.array(passive, dtype=np.int_)])


def not_judged_at_rest(records: Sequence[Record]) -> tuple[Record, ...]:
    """Return the records without weight where an output stands still that moves in another log.

    Friction at rest, or a brake, carries an unknown part of the load, so such rows say nothing
    that the logs with motion do not say better. An output that moves in no log keeps its weight:
    its load is all that is known of it.
    """
    if len(records) < 2:
        return tuple(records)
    still = standing(records)
    return tuple(
        record if not aside.any() else replace(record, weight=frozen(record.weight * ~aside))
        for record, aside in zip(records, still, strict=True)
    )


def standing(records: Sequence[Record]) -> BoolArray:
    """Return (logs, outputs) whether an output stands still in a log and moves in another one."""
    moving = np.stack([_moving_joints(record) for record in records])
    travel = np.stack([_travel(record) for record in records])
    moving &= travel > _TREMBLES * travel.max(axis=0)
    moves = np.stack([_outputs(r, own) for r, own in zip(records, moving, strict=True)])
    return np.asarray(~moves & moves.any(axis=0))


def standing_joints(records: Sequence[Record]) -> list[str]:
    """Return a warning that names the joints that are not judged in some logs."""
    robot = records[0].robot
    found = []
    for joint, still in zip(robot.transmission.joints, standing(records).T, strict=False):
        logs = [record.name for record, aside in zip(records, still, strict=True) if aside]
        more = [f"{len(logs) - _NAMED} more"] if len(logs) > _NAMED else []
        if logs:
            found.append(f"{joint} in {', '.join([*logs[:_NAMED], *more])}")
    if not found:
        return []
    return [
        f"joints that stand still: {'; '.join(found)}. They are not judged there, because friction "
        "at rest or a brake carries an unknown part of their load."
    ]


def _moving_joints(record: Record) -> BoolArray:
    """Return (joints that can rub,) whether one moves by more than its sensors' noise."""
    moves = record.noise.moving(record.motion.velocity, record.bandwidth)
    return np.asarray(moves[rubbing(record.robot)])


def _travel(record: Record) -> FloatArray:
    """Return (joints that can rub,) the range of their motion [rad, m]."""
    robot = record.robot
    joints = [*robot.transmission.joints, *robot.passive_joints]
    columns = [robot.position_index(joint) for joint in joints]
    return np.asarray(np.ptp(record.motion.position[:, columns], axis=0))


def _outputs(record: Record, moving: BoolArray) -> BoolArray:
    """Return (outputs,) whether what stands behind an output moves, by the joints that do."""
    robot, gears = record.robot, record.robot.transmission
    # A motor turns with each joint of which its own angle is made.
    turns = (np.abs(gears.motor_from_joint) > 0.0) @ moving[: gears.size]
    of_row = dict(zip(rubbing(robot).tolist(), moving.tolist(), strict=True))
    found = np.ones(record.weight.shape[1], dtype=bool)
    for output in range(found.size):
        gear = output_gear(robot, output)
        # A base rubs nowhere.
        found[output] = (
            turns[gear] if gear is not None else of_row.get(output_row(robot, output), True)
        )
    return found
