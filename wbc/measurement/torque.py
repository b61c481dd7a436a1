"""The rotor torque of a log, whichever way the drive reports it."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.measurement.log import Log
from wbc.transmission import Transmission


def rotor_torques(log: Log, transmission: Transmission) -> FloatArray:
    """Return tau_phi (N, m) [N m] of the driven joints, in the order of the transmission.

    From `rotor_torque`; or `motor_torque` / N; or `current` times the torque constant.

    Raises:
        LogError: a joint has none of the three, or a current and no torque constant.
    """
    torques = np.empty((len(log), transmission.size))
    for k, joint in enumerate(transmission.joints):
        if log.has(f"{joint}.rotor_torque"):
            torques[:, k] = log.column(f"{joint}.rotor_torque")
        elif log.has(f"{joint}.motor_torque"):
            torques[:, k] = log.column(f"{joint}.motor_torque") / transmission.gear_ratio[k]
        elif log.has(f"{joint}.current"):
            torques[:, k] = log.column(f"{joint}.current") * _torque_constant(transmission, k)
        else:
            ways = ", ".join(f"{joint}.{w}" for w in ("rotor_torque", "motor_torque", "current"))
            ignored = ", ".join(log.source.ignored)
            hint = f" Not read, for want of a known name: {ignored}." if ignored else ""
            raise LogError(
                f"{log.source.label}: no torque of joint '{joint}': one of {ways} is needed. "
                f"There are: {', '.join(log.names)}.{hint}"
            )
    torques.setflags(write=False)
    return torques


def _torque_constant(transmission: Transmission, row: int) -> float:
    constant = float(transmission.torque_constant[row])
    if not np.isfinite(constant):
        raise LogError(
            f"the log gives a current for '{transmission.joints[row]}', but the robot no torque "
            "constant; state torque_constant (N m/A) of that gear in robot.toml."
        )
    return constant
