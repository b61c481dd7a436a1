"""The torque that a drive makes of its target, or of the duty on its winding."""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True, eq=False)
class DriveLaw:
    """What a drive makes of any motion, row by row of a log (N,): the torque on the rotor is

        clip(clip(wanted - stiffness psi, bound) - damping dpsi, limit)

    with the position psi and velocity dpsi of the motor's output [rad].

    Attributes:
        wanted: torque at psi = dpsi = 0 without bounds [N m].
        stiffness: [N m/rad].
        damping: [N m s/rad].
        bound: of the part that follows the position [N m]; a duty is within -1 and 1.
        limit: of the torque on the rotor [N m].
    """

    wanted: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    bound: FloatArray
    limit: float

    def torque(self, position: FloatArray, velocity: FloatArray) -> DriveTorque:
        """Return what the drive makes of positions and velocities (N,) of the motor's output."""
        pulled = self.wanted - self.stiffness * position
        kept = np.clip(pulled, -self.bound, self.bound)
        brake = -self.damping * velocity
        own = np.where(pulled == kept, -self.stiffness * position, 0.0)
        return DriveTorque(np.clip(kept + brake, -self.limit, self.limit), own + brake)

    def at(self, row: int, position: float, velocity: float) -> float:
        """Return the torque [N m] that the drive makes of one motion at one row."""
        bound = self.bound[row]
        kept = min(max(self.wanted[row] - self.stiffness[row] * position, -bound), bound)
        torque = kept - self.damping[row] * velocity
        return float(min(max(torque, -self.limit), self.limit))


def target_law(log: Log, transmission: Transmission, row: int) -> DriveLaw:
    """Return the law by which a drive makes torque of its target.

    At the motor's output, with psi = D^-1 q and e = psi_target - psi, a drive that commands torque
    gives N tau = kp e + kd (dpsi_target - dpsi). One that commands a duty g e gives the torque of
    `duty_law`. Both keep the torque limit. A target velocity that was not recorded is zero.

    Raises:
        LogError: the gear states no gains, or a target of its joints is missing.
    """
    joint = transmission.joints[row]
    gain = float(transmission.duty_gain[row])
    if np.isfinite(gain):
        wanted = gain * _at_motor(log, transmission, row, "target_position")
        return _winding_law(log, transmission, row, wanted, gain)
    kp, kd = float(transmission.position_gain[row]), float(transmission.velocity_gain[row])
    if not np.isfinite(kp):
        raise LogError(
            f"{log.source.label}: there is a target of '{joint}' and no torque, and the robot "
            "states no gains of its position drive (of one that sets the voltage: duty_gain "
            f"instead of kp and kd); {state_gear(joint, 'kp', 'kd')}"
        )
    wanted = kp * _at_motor(log, transmission, row, "target_position")
    if kd > 0.0:
        wanted += kd * _at_motor(log, transmission, row, "target_velocity")
    share = _powered(log, joint) / float(transmission.gear_ratio[row])
    return DriveLaw(
        wanted * share,
        kp * share,
        kd * share,
        np.full(len(log), np.inf),
        float(transmission.torque_limit[row]),
    )


def duty_law(log: Log, transmission: Transmission, row: int) -> DriveLaw:
    """Return the torque on a rotor under a recorded duty u as a law: kt (u V - kt dphi) / R.

    V is the recorded supply voltage, or else that of robot.toml; the winding is open, and gives no
    torque, while `<joint>.enabled` is 0.

    Raises:
        LogError: torque constant, resistance or supply voltage of the gear is not known.
    """
    duty = log.column(f"{transmission.joints[row]}.duty")
    return _winding_law(log, transmission, row, duty, 0.0)


def made_torque(log: Log, transmission: Transmission, row: int, law: DriveLaw) -> DriveTorque:
    """Return what a drive makes of the measured motion by its law.

    A velocity that was not recorded is the derivative of the position.

    Raises:
        LogError: a position or velocity that the law needs is missing.
    """
    nothing = np.zeros(len(log))
    follows, brakes = law.stiffness.any(), law.damping.any()
    position = _at_motor(log, transmission, row, "position") if follows else nothing
    velocity = _at_motor(log, transmission, row, "velocity") if brakes else nothing
    return law.torque(position, velocity)


def _winding_law(
    log: Log, transmission: Transmission, row: int, wanted: FloatArray, gain: float
) -> DriveLaw:
    """Return the law of a winding under the duty clip(wanted - gain psi, 1)."""
    joint = transmission.joints[row]
    ratio, limit = float(transmission.gear_ratio[row]), float(transmission.torque_limit[row])
    constant = known_number(transmission, row, "torque_constant")
    resistance = known_number(transmission, row, "resistance")
    if log.has(f"{joint}.voltage"):
        supply = log.column(f"{joint}.voltage")
    else:
        supply = np.full(len(log), known_number(transmission, row, "supply_voltage"))
    on = _powered(log, joint) * constant / resistance
    full = on * supply
    bound = np.abs(full) if gain else np.full(len(log), np.inf)
    return DriveLaw(full * wanted, full * gain, on * constant * ratio, bound, limit)


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
