"""How hard the motors can brake their joints through lossy gears."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.errors import ControlError
from wbc.robot import Robot
from wbc.transmission import Transmission


@final
@dataclass(frozen=True)
class MotorBraking:
    """The deceleration that a motor's own torque gives its joint.

    A joint that is braked drives its motor, so the teeth help: of the torque T that holds it back
    only eta_b T arrives at the motor, which also has its own rotor to stop. With the inertia M of
    the joint, the others locked, and the load c on it (gravity, contact forces, what its motion
    asks),

        |T| = (U - N^2 I_r b)/eta_b,   M b = |T| +- c
        b = (U/eta_b +- c)/(M + N^2 I_r/eta_b),

    plus where the load helps. A gear that cannot be driven backwards brakes as hard as one likes.
    The load is that of the last tick; `share` leaves room for what changes until the joint rests.

    Attributes:
        share: of the motor's torque limit that braking may count on, in (0, 1].
        least: deceleration [rad/s^2] to count on where the load leaves none.
    """

    share: float = 0.8
    least: float = 1.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0.0 < self.share <= 1.0:
            raise ControlError(f"motor braking: share must lie in (0, 1], got {self.share:g}.")
        if not self.least > 0.0:
            raise ControlError(f"motor braking: least must be > 0 rad/s^2, got {self.least:g}.")

    def check(self, robot: Robot, joints: tuple[str, ...]) -> None:
        """Raise ControlError for a joint that is not driven by a motor of its own."""
        own = serial_gears(robot.transmission)
        for joint in joints:
            if joint not in own:
                raise ControlError(
                    f"joint '{joint}' has no motor of its own to brake it; give its braking as a "
                    f"number (acceleration=...). Joints that have one: {', '.join(own)}."
                )

    def strength(
        self, gears: Transmission, rows: IntArray, inertia: FloatArray, load: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the deceleration (k,) [rad/s^2] of motion upwards and of motion downwards.

        Args:
            gears: of the robot.
            rows: which gear drives each joint, (k,).
            inertia: M (k,) [kg m^2] of the joints.
            load: c (k,) [N m], positive where it pulls a joint down.
        """
        backward = gears.backward_efficiency[rows]
        free = backward > 0.0
        eta = np.where(free, backward, 1.0)
        torque = self.share * np.abs(gears.gear_ratio * gears.torque_limit)[rows] / eta
        whole = inertia + gears.reflected_inertia[rows] / eta
        up, down = (torque + load) / whole, (torque - load) / whole
        return (
            np.where(free, np.maximum(up, self.least), np.inf),
            np.where(free, np.maximum(down, self.least), np.inf),
        )


def serial_gears(gears: Transmission) -> dict[str, int]:
    """Return the joints that have a motor of their own, with its number."""
    topology = np.asarray(gears.topology)
    alone = [
        i
        for i in range(gears.size)
        if topology[i, i] == 1.0
        and np.count_nonzero(topology[i]) == 1
        and np.count_nonzero(topology[:, i]) == 1
    ]
    return {gears.joints[i]: i for i in alone}
