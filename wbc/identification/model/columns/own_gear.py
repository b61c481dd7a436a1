"""Effects that one gear alone feels: those of many gears are seen in one evaluation.

What a gear must give depends on its own mesh, rotor and drive, not on those of others. Changes at
several gears that do not share an output are therefore made together, and each output shows its
own (Curtis, Powell, Reid, "On the estimation of sparse Jacobian matrices", 1974).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import IntArray
from wbc.identification.records.outputs import output_count, output_gear
from wbc.identification.records.record import Record
from wbc.robot import Effect, Robot

_AT_GEAR = frozenset(
    {"drive", "drive_inverse", "gear_efficiencies", "meshed", "rotor_torque", "change"}
)
_PER_JOINT = ("gear_ratio", "topology")  # numbers of gears by which they share what links need


def own_gear(robot: Robot, effect: Effect, records: Sequence[Record]) -> int | None:
    """Return the number of the gear that alone feels an effect, None where more may.

    Args:
        robot: that lacks the effect.
        effect: that the robot can have.
        records: the logs.
    """
    if effect.where not in robot.transmission.joints or not effect.acts_by <= _AT_GEAR:
        return None
    # Contact forces that nobody measured follow from all gears; rotors that turn with links move
    # other joints.
    if robot.rotors_turn_with_links or any(record.balance is not None for record in records):
        return None
    changed = effect.change(robot)
    if changed.model is not robot.model:
        return None
    one, other = robot.transmission, changed.transmission
    if not all(np.array_equal(getattr(one, name), getattr(other, name)) for name in _PER_JOINT):
        return None
    return one.index(effect.where)


def outputs_of(robot: Robot, gear: int) -> IntArray:
    """Return the numbers of the outputs of a gear: its own, and that of a sensor behind it."""
    every = range(output_count(robot))
    return np.array([k for k in every if output_gear(robot, k) == gear], dtype=np.int_)
