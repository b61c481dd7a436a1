"""A motion of the robot, one sample or many, as the physical effects see it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from wbc.arrays import FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Memory:
    """An effect's own state in one step of a simulator.

    Attributes:
        value: the state at the start of the step, laid out by the effect.
        step: length of the step [s]; the motion's sample is its middle.
    """

    value: FloatArray
    step: float


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions, velocities and what else was known at the same instants.

    Leading axes are free: one sample is (nq,) and (nv,), a whole log is (N, nq) and (N, nv).

    Attributes:
        position: q (..., nq), pinocchio's configuration vector [m, rad, quaternion].
        velocity: v (..., nv) [m/s, rad/s].
        acceleration: a (..., nv), or None where it is not known yet (a simulator's step).
        time: (...) [s], or None.
        temperature: (..., m) of the motors [deg C], or None.
        supply_voltage: (..., m) [V] at the motor drives, or None.
        feedback_torque: (..., m) on the rotors [N m]: what position drives command because of the
            motion they measure, not of their target; None where no drive follows a target.
        mesh_torque: T (..., m) [N m] that the gears give, where a simulator solves for it.
        memory: own state of the effect that is asked, where a simulator carries it; else None.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray | None = None
    time: FloatArray | None = None
    temperature: FloatArray | None = None
    supply_voltage: FloatArray | None = None
    feedback_torque: FloatArray | None = None
    mesh_torque: FloatArray | None = None
    memory: Memory | None = None

    def replace(self, **changes: Any) -> Motion:
        """Return a copy with some fields changed."""
        return replace(self, **changes)
