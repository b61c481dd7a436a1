"""Motion of the motor outputs, which differs from the joints' where gears are loose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.sim.laws.drivetrain import Drivetrain
from wbc.sim.state import SimState


@dataclass(frozen=True, eq=False, slots=True)
class MotorMotion:
    """Motor outputs at one instant.

    Attributes:
        speed: psi_dot (m,) [rad/s].
        relative: (m,) psi_dot less what the joints would make it.
        deflection: (m,) [rad] of the motor output ahead of the joint.
    """

    speed: FloatArray
    relative: FloatArray
    deflection: FloatArray

    @classmethod
    def of(cls, drive: Drivetrain, state: SimState) -> MotorMotion:
        """Return the motion that a state holds; gears that are not loose follow the joints."""
        joint = drive.rows @ state.velocity
        if not drive.any_loose:
            return cls(joint, drive.zero, drive.zero)
        given = state.motor_velocity if len(state.motor_velocity) else joint
        motor = np.where(drive.loose, given, joint)
        deflection = state.deflection if len(state.deflection) else drive.zero
        return cls(motor, motor - joint, deflection)

    def after(
        self, drive: Drivetrain, velocity: FloatArray, speed: FloatArray, step: float
    ) -> MotorMotion:
        """Return the motion a step later, at v (nv,) and motor speeds (m,)."""
        if not drive.any_loose:
            return MotorMotion(speed, self.relative, self.deflection)
        relative = np.where(drive.loose, speed - drive.rows @ velocity, 0.0)
        deflection = self.deflection + 0.5 * step * (self.relative + relative)
        return MotorMotion(speed, relative, deflection)


def rotor_motion(
    drive: Drivetrain, actuated_position: IntArray, state: SimState
) -> tuple[FloatArray, FloatArray]:
    """Return angles (m,) [rad] and speeds (m,) [rad/s] of the rotors, zero where the joints are."""
    motor = MotorMotion.of(drive, state)
    joint = drive.rows[:, drive.actuated] @ state.position[actuated_position]
    return drive.ratio * (joint + motor.deflection), drive.ratio * motor.speed
