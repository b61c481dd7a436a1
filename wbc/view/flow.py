"""Power through the gears of a recorded motion: what drives what, when, and what is lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.transmission import Transmission, direction
from wbc.view.channels import (
    jump_rows,
    log_impacts,
    rate_of_change,
    rotor_torque,
    velocity,
    window_mean,
)

STILL_SPEED = 0.02
"""[rad/s] below which a picture calls a gear stuck: several times an encoder's noise."""

_IDLE_SHARE = 0.005


@dataclass(frozen=True, eq=False)
class GearFlow:
    """Torque and power of every gear along a log; NaN where the log holds no torque.

    All but `rotor_torque` are averaged over 20 ms, never across an impact, at which speeds jump.

    Attributes:
        rotor_torque: tau_phi (N, m) [N m] on the rotors, as logged.
        speed: dpsi (N, m) [rad/s] at the motor outputs.
        rotor_power: tau_phi dphi (N, m) [W].
        mesh_power: t dpsi (N, m) [W], what enters the teeth after the rotor's own inertia and
            friction are paid; positive where the motor drives.
        loss: (N, m) [W] >= 0, turned into heat by rotor friction and teeth.
        direction: (N, m) of +1 forward, -1 backward, 0 stuck or idle (below 0.5 % of the largest
            power in the log).
    """

    rotor_torque: FloatArray
    speed: FloatArray
    rotor_power: FloatArray
    mesh_power: FloatArray
    loss: FloatArray
    direction: FloatArray


def gear_flow(robot: Robot, log: Log, window: float = 0.02) -> GearFlow:
    """Return the power through the gears of `robot` along `log`.

    Good enough for a picture; the average is no estimate to identify with.

    Args:
        robot: whose gears and rotors.
        log: positions or velocities, and torques.
        window: [s] to average over.
    """
    gears = robot.transmission
    torque = rotor_torque(robot, log)
    raw = velocity(robot, log)[:, robot.actuated] @ gears.motor_from_joint.T
    hits = [int(np.searchsorted(log.time, impact.time)) for impact in log_impacts(robot, log)]
    jumps = jump_rows(raw, hits)
    width = round(window / log.sample_time)
    speed = window_mean(raw, width, jumps)
    acceleration = rate_of_change(speed, log.time, jumps)
    mesh, loss = gear_powers(gears, torque, speed, acceleration)
    # The mean of the losses, not the loss of the mean: torque that shakes a gear costs heat too.
    loss, power = window_mean(loss, width, jumps), window_mean(mesh, width, jumps)
    largest = float(np.nanmax(np.abs(power))) if np.isfinite(power).any() else 0.0
    moving = direction(power, deadband=_IDLE_SHARE * largest)
    towards = np.where(np.abs(speed) < STILL_SPEED, 0.0, moving)
    drive = window_mean(torque * gears.gear_ratio * speed, width, jumps)
    return GearFlow(torque, speed, drive, power, loss, towards)


def gear_powers(
    gears: Transmission, torque: FloatArray, speed: FloatArray, acceleration: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the mesh input power and the loss of every gear, both (..., m) [W].

    Args:
        gears: m of them.
        torque: tau_phi (..., m) [N m] on the rotors.
        speed: dpsi (..., m) [rad/s] at the motor outputs.
        acceleration: (..., m) [rad/s^2] of them.
    """
    spin = gears.gear_ratio * speed
    friction = gears.rotor_coulomb_friction * np.sign(spin) + gears.rotor_viscous_friction * spin
    mesh = gears.gear_ratio * (torque - friction) - gears.reflected_inertia * acceleration
    return mesh * speed, tooth_loss(gears, mesh * speed) + friction * spin


def tooth_loss(gears: Transmission, mesh_power: FloatArray) -> FloatArray:
    """Return what the teeth turn into heat (..., m) [W] at a mesh input power (..., m).

    Forward the output gets eta_f of the input; backward the input gets eta_b of what the joint
    gives, so the joint gives P/eta_b. A self-locking gear that is pushed backward takes nothing
    through its teeth: all power that the motor still absorbs comes out of measurement error, and
    none is counted.
    """
    backward = gears.backward_efficiency
    share = np.where(backward > 0.0, 1.0 / np.where(backward > 0.0, backward, 1.0) - 1.0, 0.0)
    forward = (1.0 - gears.forward_efficiency) * np.maximum(mesh_power, 0.0)
    return np.asarray(forward + share * np.maximum(-mesh_power, 0.0))
