"""Torque columns that hold something else than their names say."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from wbc.arrays import BoolArray
from wbc.errors import IdentificationError
from wbc.identification.agreement import Agreement
from wbc.measurement import Log, torque_quantity
from wbc.robot import Robot

_DRIVE = 4.0  # times too much or too little that constants, losses and loads may amount to
_NEAR = 0.3  # natural logarithm of a gain over the gear ratio
_VERY_NEAR = 0.15  # the same where other joints of the log report what is needed
_VERY_CLEAR = 0.97  # correlation, likewise
_SIGN = 2.5  # times by which a reversed report may be too large or too small

_AFTER = "the log gives torque after the reduction as {}"
_BEFORE = "the log gives torque before the reduction as {}"
_TWICE = "the gear ratio was applied once too often to {}"
_CONSTANT = "the torque constants belong to the other side of the gear"
_MAP = '{} in a column map (--columns MAP.toml): "{}" = {{ from = ..., side = "{}" }}'
_RENAME = "Call them {}, or say so"
_WITHOUT = (
    "Leave out what converts them (side = ..., scale = ...) in the column map (--columns MAP.toml)"
)
_STATE = "State torque_constant of these gears in robot.toml [N m/A on the rotor]"


def require_right_side(robot: Robot, logs: Sequence[Log], agreements: Sequence[Agreement]) -> None:
    """Check that no log reports about N times, or 1/N of, the torque that its motion needs.

    Args:
        robot: the robot that the user believes in.
        logs: as prepared.
        agreements: of each.

    Raises:
        IdentificationError: the joints that carry torque do so beyond what a drive, a gear or a
            payload explains.
    """
    for log, agreement in zip(logs, agreements, strict=True):
        for power in (1.0, -1.0):
            wrong = _on_wrong_side(robot, agreement, power)
            if wrong.any():
                raise IdentificationError(_side_error(robot, log, agreement, wrong, power))


def reversed_torques(
    robot: Robot, logs: Sequence[Log], agreements: Sequence[Agreement]
) -> list[str]:
    """Return a warning for every joint whose report follows its need with the opposite sign."""
    found: dict[int, list[int]] = {}
    for number, agreement in enumerate(agreements):
        gain = np.maximum(np.abs(agreement.gain), 1e-300)
        near = agreement.clear & (np.abs(np.log(gain)) < np.log(_SIGN)) & (agreement.gain < 0.0)
        for k in np.flatnonzero(near):
            found.setdefault(int(k), []).append(number)
    return [_sign_warning(robot, logs, agreements, k, numbers) for k, numbers in found.items()]


def _on_wrong_side(robot: Robot, agreement: Agreement, power: float) -> BoolArray:
    """Return (m,) whose gain is the gear ratio to this power; nobody's where most are right."""
    ratio = np.abs(robot.transmission.gear_ratio) ** power
    gain = np.maximum(np.abs(agreement.gain), 1e-300)
    away = np.abs(np.log(gain / ratio))
    beyond = agreement.clear & (np.abs(np.log(gain)) > np.log(_DRIVE))
    wrong = beyond & (away < _NEAR)
    if (wrong == agreement.clear).all():
        return np.asarray(wrong)
    # One misread column among right ones; a payload at the end of an arm may come close to that.
    wrong &= (away < _VERY_NEAR) & (np.abs(agreement.correlation) > _VERY_CLEAR)
    enough = 2 * np.count_nonzero(wrong) >= np.count_nonzero(agreement.clear)
    return np.asarray(wrong & enough)


def _side_error(
    robot: Robot, log: Log, agreement: Agreement, wrong: BoolArray, power: float
) -> str:
    gears = robot.transmission
    rows = [int(k) for k in np.flatnonzero(wrong)]
    joints = [gears.joints[k] for k in rows]
    quantity = torque_quantity(log, joints[0])
    columns = [f"{joint}.{torque_quantity(log, joint)}" for joint in joints]
    ratios = _listed(f"{abs(gears.gear_ratio[k]):g}" for k in rows)
    gains = _listed(f"{abs(agreement.gain[k]):.3g}" for k in rows)
    if quantity == "current":
        cause, remedy = _CONSTANT, _STATE
    elif (quantity == "rotor_torque") == (power > 0.0):
        other, side = ("motor_torque", "motor") if power > 0.0 else ("rotor_torque", "rotor")
        renamed = _RENAME.format(_listed(f"{joint}.{other}" for joint in joints))
        cause = (_AFTER if power > 0.0 else _BEFORE).format(_listed(columns))
        remedy = _MAP.format(renamed, columns[0], side)
    else:
        cause, remedy = _TWICE.format(_listed(columns)), _WITHOUT
    return (
        f"{log.source.label}: the torque reported for {_listed(joints)} is {gains} times what "
        f"the motion needs, and the gear ratio is {ratios}: {cause}? {remedy}."
    )


def _sign_warning(
    robot: Robot,
    logs: Sequence[Log],
    agreements: Sequence[Agreement],
    joint: int,
    numbers: Sequence[int],
) -> str:
    name = robot.transmission.joints[joint]
    column = f"{name}.{torque_quantity(logs[numbers[0]], name)}"
    where = (
        "" if len(numbers) == len(logs) else f" in {_listed(logs[k].source.label for k in numbers)}"
    )
    correlation = float(np.mean([agreements[k].correlation[joint] for k in numbers]))
    return (
        f"the sign of {column} is reversed{where}? It follows the negative of what the motion "
        f"needs (correlation {correlation:.2f}). If so, state it in a column map (--columns "
        f'MAP.toml): "{column}" = {{ from = ..., sign = -1 }}; the position of {name} may be the '
        "reversed one instead, or the robot hang the other way up."
    )


def _listed(texts: Iterable[str]) -> str:
    """Return 'a, b and c', or 'a' where all texts are the same."""
    *first, last = list(texts)
    if all(text == last for text in first):
        return last
    return f"{', '.join(first)} and {last}" if first else last
