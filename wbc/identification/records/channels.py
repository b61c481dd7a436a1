"""Reading the robot's channels out of a log, on an even time grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.identification.readings import (
    feedback_torques,
    rotor_torques,
    tells_torque,
    torque_sources,
    without_position,
)
from wbc.identification.readings.torque import contact_forces, positions, velocities
from wbc.identification.records.contacts import active_contacts
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.transmission import DRIVE_TIMES

_EVEN = 1e-3  # time stamps that stray less than this share of a step count as even


@dataclass(frozen=True, eq=False)
class Channels:
    """The channels of one log that a robot understands, resampled where stamps jitter.

    Attributes:
        name: of the log.
        rate: [Hz].
        time: (N,) [s].
        position: (N, nq); of `placeless` joints the integral of the velocity.
        velocity: (N, nv), or None if some joint has no velocity channel.
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
    velocity: FloatArray | None
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


def read_channels(robot: Robot, log: Log) -> Channels:
    """Return what a log that `require_readable` let pass says about `robot`.

    Raises:
        LogError: the torque of a driven joint or the position of a joint is missing.
        IdentificationError: a free base without forces.
    """
    step = log.sample_time
    count = int(np.floor(log.duration / step + 1e-6)) + 1
    grid = log.time[0] + step * np.arange(count)
    even = count == len(log) and np.abs(log.time - grid).max() < _EVEN * step

    def on_grid(values: FloatArray) -> FloatArray:
        if even:
            return values
        found = np.empty((count, values.shape[1]))
        for k, column in enumerate(values.T):
            found[:, k] = np.interp(grid, log.time, column)
        return found

    joints = robot.transmission.joints
    velocity = velocities(robot, log)
    forces = {name: on_grid(force) for name, force in contact_forces(robot, log).items()}
    position = on_grid(positions(robot, log))
    active = active_contacts(robot, log, grid, position)
    torque, feedback, reported = _torque(robot, log)
    return Channels(
        name=log.source.label,
        rate=1.0 / step,
        time=grid,
        position=position,
        velocity=None if velocity is None else on_grid(velocity),
        torque=on_grid(torque),
        feedback=None if feedback is None else on_grid(feedback),
        reported=reported,
        currents=(np.array(torque_sources(log, robot.transmission)) == "current") & reported,
        sensed=on_grid(log.stack("joint_torque", robot.torque_sensors)),
        forces=forces,
        active=active,
        temperature=_optional(log, "temperature", joints, on_grid),
        supply_voltage=_optional(log, "voltage", joints, on_grid),
        inertia=None if log.machine is None else log.machine.inertia,
        placeless=() if velocity is None else without_position(robot, log),
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


def _optional(
    log: Log,
    quantity: str,
    joints: tuple[str, ...],
    on_grid: Callable[[FloatArray], FloatArray],
) -> FloatArray | None:
    if not log.has(*(f"{joint}.{quantity}" for joint in joints)):
        return None
    return on_grid(log.stack(quantity, joints))
