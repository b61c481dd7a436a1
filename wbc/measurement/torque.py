"""The rotor torque of a log, whichever way the drive reports it or is told to make it."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, frozen
from wbc.errors import LogError
from wbc.measurement.log import Log
from wbc.transmission import Transmission

REPORTED = ("rotor_torque", "motor_torque", "current")
"""Quantities that a drive reports its torque by."""

_QUANTITIES = (*REPORTED, "target_position")


def rotor_torques(log: Log, transmission: Transmission) -> FloatArray:
    """Return tau_phi (N, m) [N m] of the driven joints, in the order of the transmission.

    From `rotor_torque`; or `motor_torque` / N; or `current` times the torque constant; or, where
    none of them was recorded, the torque that a position drive commands (`drive_torques`).

    Raises:
        LogError: a joint has none of the four, a current and no torque constant, or a target and
            no drive gains.
    """
    torques = np.empty((len(log), transmission.size))
    for k, joint in enumerate(transmission.joints):
        quantity = torque_quantity(log, joint)
        if quantity == "target_position":
            torques[:, k] = drive_torques(log, transmission, k)[0]
            continue
        torques[:, k] = log.column(f"{joint}.{quantity}")
        if quantity == "motor_torque":
            torques[:, k] /= transmission.gear_ratio[k]
        elif quantity == "current":
            torques[:, k] *= _torque_constant(transmission, k)
    return frozen(torques)


def feedback_torques(log: Log, transmission: Transmission) -> FloatArray | None:
    """Return the part (N, m) [N m] of `rotor_torques` that drives make of the measured motion.

    A target comes late over a bus; the drive's own measurement does not. What is left when this
    part is taken away follows the target. None where no torque comes from a target.
    """
    targets = [
        k
        for k, joint in enumerate(transmission.joints)
        if torque_quantity(log, joint) == "target_position"
    ]
    if not targets:
        return None
    feedback = np.zeros((len(log), transmission.size))
    for k in targets:
        feedback[:, k] = drive_torques(log, transmission, k)[1]
    return frozen(feedback)


def drive_torques(log: Log, transmission: Transmission, row: int) -> tuple[FloatArray, FloatArray]:
    """Return the torque on a rotor (N,) that a position drive commands, and its feedback part.

    At the motor's output, with psi = D^-1 q: N tau = kp (psi_target - psi) + kd (dpsi_target -
    dpsi), within N times the torque limit. The feedback part is -kp psi - kd dpsi. A velocity that
    was not recorded is the derivative of the position; a target velocity that was not, zero.

    Raises:
        LogError: the gear states no gains, or a position or target of its joints is missing.
    """
    joint = transmission.joints[row]
    kp, kd = float(transmission.position_gain[row]), float(transmission.velocity_gain[row])
    if not np.isfinite(kp):
        raise LogError(
            f"{log.source.label}: there is a target of '{joint}' and no torque, and the robot "
            "states no gains of its position drive; add kp (N m/rad) and kd (N m s/rad) of "
            f"[gears.{joint}] to robot.toml."
        )
    wanted, feedback = np.zeros(len(log)), np.zeros(len(log))
    for share, other in zip(transmission.motor_from_joint[row], transmission.joints, strict=True):
        if share == 0.0:
            continue
        position = log.column(f"{other}.position")
        wanted += share * kp * log.column(f"{other}.target_position")
        feedback -= share * kp * position
        if kd == 0.0:
            continue
        if log.has(f"{other}.target_velocity"):
            wanted += share * kd * log.column(f"{other}.target_velocity")
        measured = log.has(f"{other}.velocity")
        speed = log.column(f"{other}.velocity") if measured else np.gradient(position, log.time)
        feedback -= share * kd * speed
    ratio, limit = float(transmission.gear_ratio[row]), float(transmission.torque_limit[row])
    return np.clip((wanted + feedback) / ratio, -limit, limit), feedback / ratio


def reports_torque(log: Log, joint: str) -> bool:
    """Whether a log holds what the drive of a joint reports, in any of the three ways."""
    return any(log.has(f"{joint}.{quantity}") for quantity in REPORTED)


def torque_quantity(log: Log, joint: str) -> str:
    """Return which quantity the torque of a joint is read from, see `rotor_torques`.

    Raises:
        LogError: the joint has none of the four.
    """
    for quantity in _QUANTITIES:
        if log.has(f"{joint}.{quantity}"):
            return quantity
    for quantity in _QUANTITIES:
        if f"{joint}.{quantity}" in log.source.unusable:
            raise LogError(f"{log.source.label}: " + log.source.unusable[f"{joint}.{quantity}"])
    ways = ", ".join(f"{joint}.{quantity}" for quantity in REPORTED)
    ignored = ", ".join(log.source.ignored)
    hint = f" Not read, for want of a known name: {ignored}." if ignored else ""
    raise LogError(
        f"{log.source.label}: no torque of joint '{joint}': one of {ways} is needed, or "
        f"{joint}.target_position and the gains of its drive. "
        f"There are: {', '.join(log.names)}.{hint}"
    )


def _torque_constant(transmission: Transmission, row: int) -> float:
    constant = float(transmission.torque_constant[row])
    if not np.isfinite(constant):
        raise LogError(
            f"the log gives a current for '{transmission.joints[row]}', but the robot no torque "
            "constant; state torque_constant (N m/A) of that gear in robot.toml."
        )
    return constant
