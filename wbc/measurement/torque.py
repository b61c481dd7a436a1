"""The rotor torque of a log, whichever way the drive reports it or is told to make it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import BoolArray, FloatArray, frozen
from wbc.errors import LogError
from wbc.measurement.drives import (
    DriveLaw,
    duty_law,
    known_number,
    made_torque,
    target_law,
)
from wbc.measurement.log import Log
from wbc.measurement.unread import unread_columns
from wbc.transmission import Transmission

REPORTED = ("rotor_torque", "motor_torque", "current")
"""Quantities that a drive reports its torque by."""

_QUANTITIES = (*REPORTED, "duty", "target_position")


def rotor_torques(log: Log, transmission: Transmission) -> FloatArray:
    """Return tau_phi (N, m) [N m] of the driven joints, in the order of the transmission.

    From `rotor_torque`; or `motor_torque` / N; or `current` times the torque constant; or, where
    none of them was recorded, what a winding makes of the recorded duty, or a drive of its target
    (`wbc.measurement.drives`).

    Raises:
        LogError: a joint has none of these, a current and no torque constant, or a target and no
            drive gains.
    """
    torques = np.empty((len(log), transmission.size))
    for k in range(transmission.size):
        torques[:, k] = made_torque(log, transmission, k, drive_law(log, transmission, k)).torque
    return frozen(torques)


def drive_law(log: Log, transmission: Transmission, row: int) -> DriveLaw:
    """Return what a drive makes of any motion while it is told what the log says.

    The law of a drive that reports its torque is that torque, whatever the motion.

    Raises:
        LogError: as `rotor_torques`.
    """
    joint = transmission.joints[row]
    quantity = torque_quantity(log, joint, transmission)
    if quantity == "duty":
        return duty_law(log, transmission, row)
    if quantity == "target_position":
        return target_law(log, transmission, row)
    told = log.column(f"{joint}.{quantity}")
    if quantity == "motor_torque":
        told = told / transmission.gear_ratio[row]
    elif quantity == "current":
        told = told * known_number(transmission, row, "torque_constant")
    nothing, unbounded = np.zeros(len(log)), np.full(len(log), np.inf)
    return DriveLaw(told, nothing, nothing, unbounded, np.inf)


def feedback_torques(log: Log, transmission: Transmission) -> FloatArray | None:
    """Return the part (N, m) [N m] of `rotor_torques` that drives make of the measured motion.

    A target comes late over a bus; the drive's own measurement does not. What is left when this
    part is taken away follows the target. None where all drives report their torque.
    """
    joints = transmission.joints
    if all(torque_quantity(log, joint, transmission) in REPORTED for joint in joints):
        return None
    laws = [drive_law(log, transmission, k) for k in range(len(joints))]
    made = [made_torque(log, transmission, k, law).feedback for k, law in enumerate(laws)]
    return frozen(np.stack(made, axis=1))


def torque_channels(joints: Sequence[str]) -> list[str]:
    """Return the channels by which drives of these joints may report their torque.

    A torque after the reduction comes first: most drives report that.
    """
    return [f"{joint}.{name}" for joint in joints for name in ("motor_torque", *REPORTED)]


def reports_torque(log: Log, joint: str) -> bool:
    """Whether a log holds what the drive of a joint reports, in any of the three ways."""
    return any(log.has(f"{joint}.{quantity}") for quantity in REPORTED)


def reports_current(log: Log, transmission: Transmission) -> BoolArray:
    """Return (m,) whether the torque of a joint is read from the current that its drive reports."""
    above = [name for name in REPORTED if name != "current"]
    return np.array(
        [
            log.has(f"{joint}.current") and not any(log.has(f"{joint}.{name}") for name in above)
            for joint in transmission.joints
        ],
        dtype=bool,
    )


def makes_torque(log: Log, transmission: Transmission) -> BoolArray:
    """Whether (m,) a log and the numbers of a drive make a torque that nothing reported."""
    known = [
        (log.has(f"{joint}.duty") and np.isfinite(transmission.resistance[k]))
        or (
            log.has(f"{joint}.target_position")
            and np.isfinite([transmission.position_gain[k], transmission.duty_gain[k]]).any()
        )
        for k, joint in enumerate(transmission.joints)
    ]
    return np.array(known, dtype=bool)


def torque_quantity(log: Log, joint: str, transmission: Transmission) -> str:
    """Return which quantity the torque of a joint is read from, see `rotor_torques`.

    A duty counts where the gear states a resistance: else nothing says what torque it makes.

    Raises:
        LogError: the joint has none of them.
    """
    row = transmission.joints.index(joint)
    known = np.isfinite(transmission.resistance[row])
    quantities = [name for name in _QUANTITIES if name != "duty" or known]
    for quantity in quantities:
        if log.has(f"{joint}.{quantity}"):
            return quantity
    for quantity in quantities:
        if f"{joint}.{quantity}" in log.source.unusable:
            raise LogError(f"{log.source.label}: " + log.source.unusable[f"{joint}.{quantity}"])
    ways = ", ".join(f"{joint}.{quantity}" for quantity in REPORTED)
    lacking = [
        one
        for one in transmission.joints
        if not any(log.recorded(f"{one}.{quantity}") for quantity in quantities)
    ]
    hint = unread_columns(log.source.ignored, torque_channels(lacking))
    raise LogError(
        f"{log.source.label}: no torque of joint '{joint}': one of {ways} is needed, or "
        f"{joint}.target_position and the gains of its drive. "
        f"There are: {', '.join(log.names)}. {hint}".rstrip()
    )
