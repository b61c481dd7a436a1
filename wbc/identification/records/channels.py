"""What a log says of a robot: motion, forces, torques as recorded or as drives make them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter

from wbc.arrays import BoolArray, FloatArray, frozen
from wbc.dynamics import inertial_parameters
from wbc.errors import LogError
from wbc.identification.records.contacts import active_contacts
from wbc.measurement.log import OF_THE_DRIVE, Log, Machine
from wbc.measurement.schema import FREE_POSE, FREE_VELOCITY, REPORTED
from wbc.robot import Robot, state_gear
from wbc.transmission import DRIVE_TIMES, Transmission

_SOURCES = (*REPORTED, "duty", "target_position")
_EARLY = 0.1  # of a sample; 20 us of jitter in stamps 4 ms apart are 0.005
_EVEN = 1e-3  # time stamps that stray less than this share of a step count as even
_STATES = 4  # drawn at random; one that does not show a dependence has measure zero
_SAME = 1e-9  # of the torque, what rounding makes


def rotor_torques(log: Log, transmission: Transmission) -> FloatArray:
    """Return tau_phi (N, m) [N m] of the driven joints, in the order of the transmission.

    From `rotor_torque`; or `motor_torque` / N; or `current` times the torque constant; or, where
    none of them was recorded, what a winding makes of the recorded duty, or a drive of its target
    (`DriveLaw`).

    Raises:
        LogError: a joint has none of these, a current and no torque constant, or a target and no
            drive gains.
    """
    drives = range(transmission.size)
    return frozen(np.stack([made_torque(log, transmission, k).torque for k in drives], axis=1))


def drive_law(log: Log, transmission: Transmission, row: int) -> DriveLaw:
    """Return what a drive makes of any motion while it is told what the log says.

    The law of a drive that reports its torque is that torque, whatever the motion.

    Raises:
        LogError: as `rotor_torques`.
    """
    joint, source = transmission.joints[row], torque_sources(log, transmission)[row]
    if source == "target_position":
        return target_law(log, transmission, row)
    told = log.column(f"{joint}.{source or 'motor_torque'}")  # raises where there is none
    if source == "duty":
        return _winding_law(log, transmission, row, told, 0.0)
    if source == "current":
        known_number(transmission, row, "torque_constant")
    nothing, unbounded = np.zeros(len(log)), np.full(len(log), np.inf)
    told = told * reported_share(transmission, row, source)
    return DriveLaw(told, nothing, nothing, unbounded, np.inf)


def reported_share(transmission: Transmission, row: int, quantity: str) -> float:
    """Return the torque on the rotor over a quantity that its drive reports, NaN if not known."""
    if quantity == "current":
        return float(transmission.torque_constant[row])
    return 1.0 if quantity == "rotor_torque" else 1.0 / float(transmission.gear_ratio[row])


def feedback_torques(log: Log, transmission: Transmission) -> FloatArray | None:
    """Return the part (N, m) [N m] of `rotor_torques` that drives make of the measured motion.

    A target comes late over a bus; the drive's own measurement does not. What is left when this
    part is taken away follows the target. None where all drives report their torque.
    """
    if set(torque_sources(log, transmission)) <= set(REPORTED):
        return None
    drives = range(transmission.size)
    return frozen(np.stack([made_torque(log, transmission, k).feedback for k in drives], axis=1))


def torque_sources(log: Log, transmission: Transmission) -> list[str]:
    """Return (m,) the quantity that tells the torque of each drive, empty where none does.

    What a drive reports comes first, then its duty, then its target. A duty counts where the gear
    states a resistance: else nothing says what torque it makes.
    """
    resists = np.isfinite(transmission.resistance)
    pairs = zip(transmission.joints, resists, strict=True)
    held = [[q for q in _SOURCES if log.has(f"{j}.{q}") and (q != "duty" or r)] for j, r in pairs]
    return [next(iter(each), "") for each in held]


def tells_torque(log: Log, transmission: Transmission) -> BoolArray:
    """Return (m,) whether a log and the numbers of a drive tell its torque."""
    gained = np.isfinite(transmission.position_gain) | np.isfinite(transmission.duty_gain)
    sources = np.array(torque_sources(log, transmission), dtype=np.str_)
    return np.asarray((sources != "") & ((sources != "target_position") | gained))


def joint_position(log: Log, joint: str) -> FloatArray:
    """Return the position (N,) of a joint [rad, m], or the integral of its velocity from zero.

    Raises:
        LogError: the log holds neither, or a position that cannot be used.
    """
    if not _by_velocity_alone(log, joint):
        return log.column(f"{joint}.position")
    return np.asarray(cumulative_trapezoid(log.column(f"{joint}.velocity"), log.time, initial=0.0))


def without_position(robot: Robot, log: Log) -> tuple[str, ...]:
    """Return the joints whose velocity a log holds and whose position it lacks."""
    return tuple(joint for joint in robot.single_joints if _by_velocity_alone(log, joint))


def _by_velocity_alone(log: Log, joint: str) -> bool:
    return not log.recorded(f"{joint}.position") and log.has(f"{joint}.velocity")


def placeless_joints(robot: Robot, joints: Sequence[str]) -> tuple[str, ...]:
    """Return those of `joints` whose position changes neither what the links need nor a contact.

    Such are the shaft of a motor on a test bench and a flywheel: nothing hangs on them that gravity
    could turn, and their inertia is the same at every angle.
    """
    return tuple(joint for joint in joints if not _place_matters(robot, joint))


def _place_matters(robot: Robot, joint: str) -> bool:
    model, data = robot.model, robot.model.createData()
    random, row = np.random.default_rng(0), robot.velocity_index(joint)
    feet = [(model.getFrameId(contact.frame), contact.offset) for contact in robot.contacts]

    def felt(q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        torque = pin.rnea(model, data, q, v, a).copy()
        pin.framesForwardKinematics(model, data, q)
        return np.concatenate([torque, *(data.oMf[frame].act(point) for frame, point in feet)])

    for _ in range(_STATES):
        turn, v, a = random.standard_normal((3, model.nv))
        q = pin.integrate(model, robot.neutral(), turn)
        further = np.zeros(model.nv)
        further[row] = 1.0
        here, there = felt(q, v, a), felt(pin.integrate(model, q, further), v, a)
        if np.abs(there - here).max() > _SAME * max(1.0, float(np.abs(here).max())):
            return True
    return False


def with_machine(log: Log, robot: Robot, own: Robot) -> Log:
    """Return a log of `own`, a machine that differs from `robot` in its drives or its loads.

    Raises:
        LogError: it differs in something else, which all logs have to share.
    """
    theirs, ours = own.transmission, robot.transmission
    different = [
        field.name
        for field in fields(Transmission)
        if field.name not in OF_THE_DRIVE
        and not _same(getattr(theirs, field.name), getattr(ours, field.name))
    ]
    one, other = own.model, robot.model
    same = list(one.names) == list(other.names) and np.array_equal(
        one.gravity.linear, other.gravity.linear
    )
    places = zip(one.jointPlacements, other.jointPlacements, strict=False)
    if not same or not all(a.isApprox(b) for a, b in places):
        different.append("joints or gravity")
    known = {(e.name, e.where, tuple(e.values.items())) for e in robot.effects}
    different += [
        f"{e.name} at {e.where}"
        for e in own.effects
        if "change" not in e.acts_by and (e.name, e.where, tuple(e.values.items())) not in known
    ]
    if different:
        raise LogError(
            f"{log.source.label}: its robot '{own.name}' differs from '{robot.name}' in "
            f"{', '.join(different)}. The robots of logs that are judged together may differ in "
            "gains, supply voltage and torque limit of the drives and in the inertia of the links."
        )
    inertia = inertial_parameters(own) - inertial_parameters(robot)
    return replace(log, machine=Machine(theirs, frozen(inertia)))


def loaded(model: pin.Model, inertia: FloatArray | None) -> pin.Model:
    """Return a model whose links have more, (10 n_links,) or None for nothing."""
    if inertia is None:
        return model
    result = model.copy()
    for k, more in enumerate(inertia.reshape(-1, 10), start=1):
        if more.any():
            total = model.inertias[k].toDynamicParameters() + more
            result.inertias[k] = pin.Inertia.FromDynamicParameters(total)
    return result


def _same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    return one == other


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
    `_winding_law`. Both keep the torque limit. A target velocity that was not recorded is zero.
    Targets act by the gear's `target_delay` later.

    Raises:
        LogError: the gear states no gains, or a target of its joints is missing.
    """
    joint = transmission.joints[row]
    gain = float(transmission.duty_gain[row])
    if np.isfinite(gain):
        wanted = gain * _late(log, transmission, row, "target_position")
        return _winding_law(log, transmission, row, wanted, gain)
    kp = known_number(transmission, row, "position_gain", "kp")
    kd = float(transmission.velocity_gain[row])
    wanted = kp * _late(log, transmission, row, "target_position")
    if kd > 0.0:
        wanted += kd * _late(log, transmission, row, "target_velocity")
    share = _powered(log, joint) / float(transmission.gear_ratio[row])
    unbounded, limit = np.full(len(log), np.inf), float(transmission.torque_limit[row])
    return DriveLaw(wanted * share, kp * share, kd * share, unbounded, limit)


def made_torque(log: Log, transmission: Transmission, row: int) -> DriveTorque:
    """Return what a drive makes of the measured motion by its law (`drive_law`).

    A velocity that was not recorded is the derivative of the position. The drive sees both by the
    gear's `feedback_delay` later, the velocity through a filter with its `velocity_lag`.

    Raises:
        LogError: a position or velocity that the law needs is missing, or as `rotor_torques`.
    """
    law = drive_law(log, transmission, row)
    follows, brakes = law.stiffness.any(), law.damping.any()
    position, velocity = (
        _late(log, transmission, row, quantity, "feedback_delay") if felt else np.zeros(len(log))
        for quantity, felt in (("position", follows), ("velocity", brakes))
    )
    lag = float(transmission.velocity_lag[row])
    if brakes and lag > 0.0:
        velocity = _lagging(velocity, lag / log.sample_time)
    return law.torque(position, velocity)


def _winding_law(
    log: Log, transmission: Transmission, row: int, wanted: FloatArray, gain: float
) -> DriveLaw:
    """Return the law of a winding under the duty u = clip(wanted - gain psi, 1).

    It makes kt (u V - kt dphi) / R. V is the recorded supply voltage, or else that of robot.toml;
    the winding is open, and gives no torque, while `<joint>.enabled` is 0.

    Raises:
        LogError: torque constant, resistance or supply voltage of the gear is not known.
    """
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


def known_number(transmission: Transmission, row: int, name: str, key: str = "") -> float:
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


def _powered(log: Log, joint: str) -> FloatArray:
    """Return (N,) 1 while the drive is powered, 0 while its winding is open."""
    if not log.has(f"{joint}.enabled"):
        return np.ones(len(log))
    return np.asarray(log.column(f"{joint}.enabled") > 0.5, dtype=np.float64)


def _late(
    log: Log, transmission: Transmission, row: int, quantity: str, time: str = "target_delay"
) -> FloatArray:
    """Return a quantity (N,) at the output of one motor as its drive has it, by `time` later."""
    told = _at_motor(log, transmission, row, quantity)
    delay = float(getattr(transmission, time)[row])
    if not delay > 0.0 or len(log) < 2:
        return told
    then = np.maximum(log.time - delay, log.time[0])
    return np.asarray(PchipInterpolator(log.time, told)(then))


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


def positions(robot: Robot, log: Log, *, partial: bool = False) -> FloatArray:
    """Return q (N, nq); the integral of a velocity stands for a position that was not measured.

    Args:
        robot: whose joints.
        log: with their positions, and the poses of a free base and of free bodies.
        partial: what the log lacks stays neutral.

    Raises:
        LogError: it lacks the position of a joint, or the pose of a free base or body.
    """
    position = np.tile(robot.neutral(), (len(log), 1))
    for name in robot.single_joints:
        if not partial or log.has(f"{name}.position") or log.has(f"{name}.velocity"):
            position[:, robot.position_index(name)] = joint_position(log, name)
    for owner, (at, _) in robot.free_flyers.items():
        names = [f"{owner}.{quantity}" for quantity in FREE_POSE]
        if not partial or log.has(*names):
            pose = np.stack([log.column(name) for name in names], axis=1)
            pose[:, 3:] /= np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
            position[:, at : at + 7] = pose
    return position


def velocities(robot: Robot, log: Log, *, partial: bool = False) -> FloatArray:
    """Return v (N, nv), all of it NaN if one was not measured.

    Args:
        robot: whose joints.
        log: with their velocities, and those of a free base and of free bodies.
        partial: the difference of the positions stands for what was not measured, then zero.
    """
    velocity = np.zeros((len(log), robot.model.nv))
    for name in robot.single_joints:
        row = robot.velocity_index(name)
        if log.has(f"{name}.velocity"):
            velocity[:, row] = log.column(f"{name}.velocity")
        elif not partial:
            return np.full_like(velocity, np.nan)
        elif log.has(f"{name}.position"):
            velocity[:, row] = np.gradient(log.column(f"{name}.position"), log.time)
    for owner, (_, at) in robot.free_flyers.items():
        names = [f"{owner}.{quantity}" for quantity in FREE_VELOCITY]
        if log.has(*names):
            velocity[:, at : at + 6] = np.stack([log.column(name) for name in names], axis=1)
        elif not partial:
            return np.full_like(velocity, np.nan)
    return velocity


def contact_forces(robot: Robot, log: Log) -> dict[str, FloatArray]:
    """Return contact name -> force of the ground on the robot (N, 3) [N], world axes.

    An axis that the log lacks is zero; a contact of which it holds no axis is left out.
    """
    zero, forces = np.zeros(len(log)), {}
    for contact in robot.contacts:
        axes = [f"{contact.name}.force.{axis}" for axis in "xyz"]
        if any(log.has(axis) for axis in axes):
            columns = [log.column(axis) if log.has(axis) else zero for axis in axes]
            forces[contact.name] = np.stack(columns, axis=1)
    return forces


@dataclass(frozen=True, eq=False)
class Channels:
    """The channels of one log that a robot understands, resampled where stamps jitter.

    Attributes:
        name: of the log.
        rate: [Hz].
        time: (N,) [s].
        position: (N, nq); of `placeless` joints the integral of the velocity.
        velocity: (N, nv), all of it NaN if some joint has no velocity channel.
        torque: (N, m) on the rotors [N m].
        feedback: (N, m) [N m], the part of `torque` that position drives make of what they measure;
            None where no torque comes from a target.
        reported: (m,) whether the drive of a joint reports or is told a torque; 0 stands where not.
        currents: (m,) whether the torque of a drive is the current that it reports.
        sensed: (N, s) torque behind the gears of the robot's torque sensors [N m].
        forces: contact name -> (N, 3) [N].
        active: contact name -> (N,) whether it touches, of contacts without a force sensor.
        temperature: (N, m) [deg C], or None.
        supply_voltage: (N, m) [V], or None.
        inertia: (10 n_links,) what the links of this log's machine have more, or None.
        placeless: joints whose position was not measured and changes nothing.
    """

    name: str
    rate: float
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    torque: FloatArray
    feedback: FloatArray | None
    reported: BoolArray
    currents: BoolArray
    sensed: FloatArray
    forces: dict[str, FloatArray]
    active: dict[str, BoolArray]
    temperature: FloatArray | None
    supply_voltage: FloatArray | None
    inertia: FloatArray | None = None
    placeless: tuple[str, ...] = ()


def read_channels(robot: Robot, log: Log, step: float | None = None) -> Channels:
    """Return what a log that `require_readable` let pass says about `robot`.

    Args:
        robot: that the log is held against.
        log: the log.
        step: of the even clock [s]; that of the log when left out.

    Raises:
        LogError: the torque of a driven joint or the position of a joint is missing.
        IdentificationError: a free base without forces.
    """
    step = step or log.sample_time
    # A last stamp that is early by its jitter takes no sample away.
    count = int(np.floor(log.duration / step + _EARLY)) + 1
    grid = log.time[0] + step * np.arange(count)
    even = count == len(log) and np.abs(log.time - grid).max() < _EVEN * step

    def on_grid(values: FloatArray) -> FloatArray:
        if even:
            return values
        found = np.empty((count, values.shape[1]))
        for k, column in enumerate(values.T):
            found[:, k] = np.interp(grid, log.time, column)
        return found

    def optional(quantity: str) -> FloatArray | None:
        joints = robot.transmission.joints
        known = log.has(*(f"{joint}.{quantity}" for joint in joints))
        return on_grid(log.stack(quantity, joints)) if known else None

    velocity = on_grid(velocities(robot, log))
    forces = {name: on_grid(force) for name, force in contact_forces(robot, log).items()}
    position = on_grid(positions(robot, log))
    active = active_contacts(robot, log, grid, position)
    torque, feedback, reported = _torque(robot, log)
    return Channels(
        name=log.source.label,
        rate=1.0 / step,
        time=grid,
        position=position,
        velocity=velocity,
        torque=on_grid(torque),
        feedback=None if feedback is None else on_grid(feedback),
        reported=reported,
        currents=(np.array(torque_sources(log, robot.transmission)) == "current") & reported,
        sensed=on_grid(log.stack("joint_torque", robot.torque_sensors)),
        forces=forces,
        active=active,
        temperature=optional("temperature"),
        supply_voltage=optional("voltage"),
        inertia=None if log.machine is None else log.machine.inertia,
        placeless=() if np.isnan(velocity).any() else without_position(robot, log),
    )


def _torque(robot: Robot, log: Log) -> tuple[FloatArray, FloatArray | None, BoolArray]:
    """Return the drives' torque (N, m), their feedback's share, and who has one.

    It is 0 where only a sensor behind the gear reports.

    Raises:
        LogError: a joint has neither.
    """
    gears = robot.transmission
    if log.machine is not None:
        times = {name: getattr(gears, name) for name in DRIVE_TIMES}
        gears = log.machine.transmission.replace(**times)
    reported = tells_torque(log, gears)
    reported |= [joint not in robot.torque_sensors for joint in gears.joints]
    reported &= [joint not in robot.sensor_only for joint in gears.joints]
    nothing = {
        f"{joint}.rotor_torque": np.zeros(len(log))
        for joint, yes in zip(gears.joints, reported, strict=True)
        if not yes
    }
    told = log.with_columns(nothing)
    return rotor_torques(told, gears), feedback_torques(told, gears), reported


def typical_inertia(robot: Robot, channels: Sequence[Channels]) -> FloatArray:
    """Return the inertia (m,) of each driven joint with its rotor, over some places of logs."""
    found = []
    for channel in channels:
        model = loaded(robot.model, channel.inertia)
        data = model.createData()
        for q in channel.position[:: max(1, len(channel.position) // 10)]:
            found.append(np.diag(pin.crba(model, data, q))[robot.actuated])
    return np.asarray(np.mean(found, axis=0) + robot.transmission.reflected_inertia)
