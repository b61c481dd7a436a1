"""The torque that drives make: as they report it, or by the law with which they follow a target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import LogError
from wbc.measurement.log import Log
from wbc.measurement.schema import REPORTED
from wbc.robot import Robot, state_gear
from wbc.transmission import Transmission

_SOURCES = (*REPORTED, "duty", "target_position")


def sensors_as_reports(robot: Robot, log: Log) -> Log:
    """Return a log in which sensors that alone tell a torque are what perfect gears report.

    Of such joints no gear is known (`Robot.sensor_only`): a zero or a scale of the sensor is then
    that of a report.
    """
    alone = [joint for joint in robot.sensor_only if log.has(f"{joint}.joint_torque")]
    if not alone:
        return log
    behind = {f"{joint}.motor_torque": log.column(f"{joint}.joint_torque") for joint in alone}
    told = {f"{joint}.{quantity}" for joint in alone for quantity in (*REPORTED, "joint_torque")}
    return log.select(name for name in log.columns if name not in told).with_columns(behind)


class DriveTorque(NamedTuple):
    """Torque on rotors [N m], and what of it the drives make of the measured motion.

    A target comes late over a bus; the drive's own measurement does not. What is left when the
    second part is taken away follows the target.
    """

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
    limit: float = np.inf

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


def torque_sources(log: Log, transmission: Transmission) -> list[str]:
    """Return (m,) the quantity that tells the torque of each drive, empty where none does.

    What a drive reports comes first, then its duty, then its target. A duty counts where the gear
    states a resistance: else nothing says what torque it makes.
    """
    pairs = zip(transmission.joints, np.isfinite(transmission.resistance), strict=True)
    held = [[q for q in _SOURCES if log.has(f"{j}.{q}") and (q != "duty" or r)] for j, r in pairs]
    return [next(iter(each), "") for each in held]


def tells_torque(log: Log, transmission: Transmission) -> BoolArray:
    """Return (m,) whether a log and the numbers of a drive tell its torque."""
    gained = np.isfinite(transmission.position_gain) | np.isfinite(transmission.duty_gain)
    sources = np.array(torque_sources(log, transmission), dtype=np.str_)
    return np.asarray((sources != "") & ((sources != "target_position") | gained))


def reported_share(transmission: Transmission, row: int, quantity: str) -> float:
    """Return the torque on the rotor over a quantity that its drive reports, NaN if not known."""
    if quantity == "current":
        return float(transmission.torque_constant[row])
    return 1.0 if quantity == "rotor_torque" else 1.0 / float(transmission.gear_ratio[row])


def drive_law(log: Log, transmission: Transmission, row: int) -> DriveLaw:
    """Return what a drive makes of any motion while it is told what the log says.

    The law of a drive that reports its torque is that torque, whatever the motion. At the motor's
    output, with psi = D^-1 q and e = psi_target - psi, a drive that commands torque gives
    N tau = kp e + kd (dpsi_target - dpsi). One that commands a duty u, recorded or g e within -1
    and 1, makes kt (u V - kt dphi) / R with the recorded supply voltage V, or else that of
    robot.toml. Drives that follow targets keep the torque limit, give no torque while
    `<joint>.enabled` is 0, and have their targets by the gear's `target_delay` later. A target
    velocity that was not recorded is zero.

    Raises:
        LogError: the joint has no torque, current, duty or target, or the gear lacks a number that
            the law needs: a torque constant, gains, a resistance or supply voltage.
    """
    joint, source = transmission.joints[row], torque_sources(log, transmission)[row]
    unbounded, nothing = np.full(len(log), np.inf), np.zeros(len(log))
    if source in (*REPORTED, ""):
        told = log.column(f"{joint}.{source or 'motor_torque'}")  # raises where there is none
        if source == "current":
            _number(transmission, row, "torque_constant")
        told = told * reported_share(transmission, row, source)
        return DriveLaw(told, nothing, nothing, unbounded)
    ratio, limit = float(transmission.gear_ratio[row]), float(transmission.torque_limit[row])
    on = 1.0 + nothing
    if log.has(f"{joint}.enabled"):
        on = np.asarray(log.column(f"{joint}.enabled") > 0.5, dtype=np.float64)
    gain = 0.0 if source == "duty" else float(transmission.duty_gain[row])
    if np.isfinite(gain):
        own = source == "duty"
        duty = log.column(f"{joint}.duty") if own else gain * _at_motor(log, transmission, row)
        constant = _number(transmission, row, "torque_constant")
        wound = on * constant / _number(transmission, row, "resistance")
        recorded = log.columns.get(f"{joint}.voltage")
        supply = _number(transmission, row, "supply_voltage") if recorded is None else recorded
        full = wound * supply
        bound = unbounded if own else np.abs(full)
        return DriveLaw(full * duty, full * gain, wound * constant * ratio, bound, limit)
    kp, kd = _number(transmission, row, "position_gain", "kp"), transmission.velocity_gain[row]
    wanted = kp * _at_motor(log, transmission, row)
    if kd > 0.0:
        wanted += kd * _at_motor(log, transmission, row, "target_velocity")
    on /= ratio
    return DriveLaw(wanted * on, kp * on, kd * on, unbounded, limit)


def drive_torques(log: Log, transmission: Transmission) -> DriveTorque:
    """Return what the drives (N, m) make of the measured motion by their laws (`drive_law`).

    A velocity that was not recorded is the derivative of the position. A drive sees both by the
    gear's `feedback_delay` later, the velocity through a filter with its `velocity_lag`.

    Raises:
        LogError: a position or velocity that a law needs is missing, or as `drive_law`.
    """
    made = []
    for row in range(transmission.size):
        law, seen = drive_law(log, transmission, row), {}
        for quantity, slope in (("position", law.stiffness), ("velocity", law.damping)):
            seen[quantity] = np.zeros(len(log))
            if slope.any():
                seen[quantity] = _at_motor(log, transmission, row, quantity)
        lag = float(transmission.velocity_lag[row])
        if seen["velocity"].any() and lag > 0.0:
            seen["velocity"] = _lagging(seen["velocity"], lag / log.sample_time)
        made.append(law.torque(**seen))
    return DriveTorque(*(np.stack(part, axis=1) for part in zip(*made, strict=True)))


def _number(transmission: Transmission, row: int, name: str, key: str = "") -> float:
    """Return a number of a gear that its robot.toml may leave out, or states by another key.

    Raises:
        LogError: it did.
    """
    value = float(getattr(transmission, name)[row])
    joint = transmission.joints[row]
    if not np.isfinite(value):
        raise LogError(
            f"the torque of '{joint}' needs {name}, which the robot does not state; "
            + state_gear(joint, key or name)
        )
    return value


def _at_motor(
    log: Log, transmission: Transmission, row: int, quantity: str = "target_position"
) -> FloatArray:
    """Return a quantity of the joints (N,) at the output of one motor, D^-1 q, as the drive has it.

    A target comes later by `target_delay`, what the drive sees of its motion by `feedback_delay`.
    """
    targeted = quantity.startswith("target")
    delays = transmission.target_delay if targeted else transmission.feedback_delay
    total, delay = np.zeros(len(log)), float(delays[row])
    for share, joint in zip(transmission.motor_from_joint[row], transmission.joints, strict=True):
        name = f"{joint}.{quantity}"
        if share == 0.0 or (quantity == "target_velocity" and not log.has(name)):
            continue
        if quantity == "velocity" and not log.has(name):
            total += share * np.gradient(log.column(f"{joint}.position"), log.time)
        else:
            total += share * log.column(name)
    if not delay > 0.0 or len(log) < 2:
        return total
    return np.asarray(PchipInterpolator(log.time, total)(np.maximum(log.time - delay, log.time[0])))


def _lagging(values: FloatArray, lag: float) -> FloatArray:
    """Return what a filter 1 / (1 + lag s) makes of lines through values (N,), settled before.

    Args:
        values: at even steps.
        lag: its time constant in steps.
    """
    left = np.exp(-1.0 / lag)
    rise = lag * (1.0 - left)
    change = lfilter([1.0 - rise, rise - left], [1.0, -left], values - values[0])
    return np.asarray(values[0] + change)
