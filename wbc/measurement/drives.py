"""The torque that a drive makes of its target, or of the duty on its winding."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.measurement.log import Log
from wbc.robot import state_gear
from wbc.transmission import Transmission


class DriveTorque(NamedTuple):
    """Torque on a rotor (N,) [N m], and what of it the drive makes of the measured motion."""

    torque: FloatArray
    feedback: FloatArray


def target_torque(log: Log, transmission: Transmission, row: int) -> DriveTorque:
    """Return the torque on a rotor that a drive makes of its target.

    At the motor's output, with psi = D^-1 q and e = psi_target - psi, a drive that commands torque
    gives N tau = kp e + kd (dpsi_target - dpsi), with the feedback -kp psi - kd dpsi. One that
    commands a duty g e gives the torque of `winding_torque`; its feedback is what the winding makes
    of -g psi while the duty is within its limits, and the back-EMF. Both keep the torque limit. A
    velocity that was not recorded is the derivative of the position; a target velocity, zero.

    Raises:
        LogError: the gear states no gains, or a position or target of its joints is missing.
    """
    joint = transmission.joints[row]
    if np.isfinite(transmission.duty_gain[row]):
        return _by_duty(log, transmission, row)
    kp, kd = float(transmission.position_gain[row]), float(transmission.velocity_gain[row])
    if not np.isfinite(kp):
        raise LogError(
            f"{log.source.label}: there is a target of '{joint}' and no torque, and the robot "
            "states no gains of its position drive (of one that sets the voltage: duty_gain "
            f"instead of kp and kd); {state_gear(joint, 'kp', 'kd')}"
        )
    wanted = kp * _at_motor(log, transmission, row, "target_position")
    feedback = -kp * _at_motor(log, transmission, row, "position")
    if kd > 0.0:
        wanted += kd * _at_motor(log, transmission, row, "target_velocity")
        feedback -= kd * _at_motor(log, transmission, row, "velocity")
    ratio, limit = float(transmission.gear_ratio[row]), float(transmission.torque_limit[row])
    torque = np.clip((wanted + feedback) / ratio, -limit, limit)
    return DriveTorque(torque * _powered(log, joint), feedback / ratio)


def winding_torque(log: Log, transmission: Transmission, row: int) -> DriveTorque:
    """Return the torque on a rotor under a recorded duty u: kt (u V - kt dphi) / R.

    V is the recorded supply voltage, or else that of robot.toml; the winding is open, and gives no
    torque, while `<joint>.enabled` is 0. The feedback is the back-EMF's.

    Raises:
        LogError: torque constant, resistance or supply voltage of the gear is not known.
    """
    duty = log.column(f"{transmission.joints[row]}.duty")
    return _winding(log, transmission, row, duty, np.zeros(len(log)))


def _by_duty(log: Log, transmission: Transmission, row: int) -> DriveTorque:
    gain = float(transmission.duty_gain[row])
    own = -gain * _at_motor(log, transmission, row, "position")
    duty = gain * _at_motor(log, transmission, row, "target_position") + own
    limited = np.clip(duty, -1.0, 1.0)
    return _winding(log, transmission, row, limited, np.where(duty == limited, own, 0.0))


def _winding(
    log: Log, transmission: Transmission, row: int, duty: FloatArray, own: FloatArray
) -> DriveTorque:
    """Return what a winding gives under a duty (N,) of which `own` (N,) comes from its motion."""
    joint = transmission.joints[row]
    ratio, limit = float(transmission.gear_ratio[row]), float(transmission.torque_limit[row])
    constant = known_number(transmission, row, "torque_constant")
    resistance = known_number(transmission, row, "resistance")
    if log.has(f"{joint}.voltage"):
        supply = log.column(f"{joint}.voltage")
    else:
        supply = np.full(len(log), known_number(transmission, row, "supply_voltage"))
    slope = constant / resistance
    brake = -slope * constant * ratio * _at_motor(log, transmission, row, "velocity")
    torque = np.clip(slope * duty * supply + brake, -limit, limit)
    on = _powered(log, joint)
    return DriveTorque(torque * on, (slope * own * supply + brake) * on)


def known_number(transmission: Transmission, row: int, name: str) -> float:
    """Return a number of a gear that its robot.toml may leave out.

    Raises:
        LogError: it did.
    """
    value = float(getattr(transmission, name)[row])
    joint = transmission.joints[row]
    if not np.isfinite(value):
        raise LogError(
            f"the torque of '{joint}' needs {name}, which the robot does not state; "
            + state_gear(joint, name)
        )
    return value


def _powered(log: Log, joint: str) -> FloatArray:
    """Return (N,) 1 while the drive is powered, 0 while its winding is open."""
    if not log.has(f"{joint}.enabled"):
        return np.ones(len(log))
    return np.asarray(log.column(f"{joint}.enabled") > 0.5, dtype=np.float64)


def _at_motor(log: Log, transmission: Transmission, row: int, quantity: str) -> FloatArray:
    """Return a quantity of the joints (N,) as the output of one motor has it, D^-1 q."""
    total = np.zeros(len(log))
    for share, joint in zip(transmission.motor_from_joint[row], transmission.joints, strict=True):
        if share == 0.0:
            continue
        if log.has(f"{joint}.{quantity}"):
            total += share * log.column(f"{joint}.{quantity}")
        elif quantity == "velocity":
            total += share * np.gradient(log.column(f"{joint}.position"), log.time)
        elif quantity != "target_velocity":
            log.column(f"{joint}.{quantity}")  # raises: it is missing
    return total
