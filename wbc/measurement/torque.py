"""The rotor torque of a log, whichever way the drive reports it."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.measurement.log import Log
from wbc.transmission import Transmission

_QUANTITIES = ("rotor_torque", "motor_torque", "current")


def rotor_torques(log: Log, transmission: Transmission) -> FloatArray:
    """Return tau_phi (N, m) [N m] of the driven joints, in the order of the transmission.

    From `rotor_torque`; or `motor_torque` / N; or `current` times the torque constant.

    Raises:
        LogError: a joint has none of the three, or a current and no torque constant.
    """
    torques = np.empty((len(log), transmission.size))
    for k, joint in enumerate(transmission.joints):
        quantity = torque_quantity(log, joint)
        torques[:, k] = log.column(f"{joint}.{quantity}")
        if quantity == "motor_torque":
            torques[:, k] /= transmission.gear_ratio[k]
        elif quantity == "current":
            torques[:, k] *= _torque_constant(transmission, k)
    torques.setflags(write=False)
    return torques


def reports_torque(log: Log, joint: str) -> bool:
    """Whether a log holds what the drive of a joint reports, in any of the three ways."""
    return any(log.has(f"{joint}.{quantity}") for quantity in _QUANTITIES)


def torque_quantity(log: Log, joint: str) -> str:
    """Return which quantity the torque of a joint is read from, see `rotor_torques`.

    Raises:
        LogError: the joint has none of the three.
    """
    for quantity in _QUANTITIES:
        if log.has(f"{joint}.{quantity}"):
            return quantity
    for quantity in _QUANTITIES:
        if f"{joint}.{quantity}" in log.source.unusable:
            raise LogError(f"{log.source.label}: " + log.source.unusable[f"{joint}.{quantity}"])
    ways = ", ".join(f"{joint}.{quantity}" for quantity in _QUANTITIES)
    ignored = ", ".join(log.source.ignored)
    hint = f" Not read, for want of a known name: {ignored}." if ignored else ""
    raise LogError(
        f"{log.source.label}: no torque of joint '{joint}': one of {ways} is needed. "
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
