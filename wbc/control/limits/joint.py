"""How far, how fast and how hard joints may move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray, IntArray, checked, frozen
from wbc.control.limits.motor_braking import MotorBraking, serial_gears
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False)
class JointLimit:
    """Position, velocity and acceleration limits of joints, as bounds on their accelerations.

    With braking at most b, a joint at distance d from its stop may not be faster than
    sqrt(2 b d); the bound on the acceleration over one step h is the least of

        (v_max - v)/h,   a such that (v + h a)^2 = 2 b (d - h v - h^2 a/2),   a_max,

    the second judging speed and distance at the end of the step, so that a joint which keeps it
    can always stop in time (a viable state stays viable, Del Prete 2018). A joint already beyond
    its stop or too fast for it brakes with b at most.

    Attributes:
        joints: names, in the order of the arrays.
        rows: velocity rows (k,) of the joints.
        position_rows: position rows (k,).
        lower, upper: stops (k,) [rad or m].
        speed: greatest speed (k,) [rad/s or m/s].
        acceleration: greatest acceleration (k,), which is also the greatest braking b.
        braking: what the motors can do about it, None where they can always brake with b.
        gears: number of the gear of each joint (k,), where `braking` is given.
    """

    joints: tuple[str, ...]
    rows: IntArray
    position_rows: IntArray
    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    braking: MotorBraking | None = None
    gears: IntArray | None = None

    @classmethod
    def of(
        cls,
        robot: Robot,
        joints: Sequence[str] | None = None,
        *,
        acceleration: float | FloatArray = 100.0,
        margin: float = 0.0,
        braking: MotorBraking | None = None,
    ) -> JointLimit:
        """Return the limits that the robot's model states.

        Args:
            robot: the robot.
            joints: names of one-degree joints, all driven ones when left out.
            acceleration: greatest acceleration and braking [rad/s^2], one number or one per joint.
            margin: distance kept from every stop [rad].
            braking: how hard the motors can brake; left out they can with `acceleration`.

        Raises:
            ControlError: an acceleration that is not positive, or stops that leave no room.
            RobotError: no such joint.
        """
        names = robot.transmission.joints if joints is None else tuple(joints)
        rows = [robot.velocity_index(joint) for joint in names]
        places = [robot.position_index(joint) for joint in names]
        lower = np.asarray(robot.model.lowerPositionLimit)[places] + margin
        upper = np.asarray(robot.model.upperPositionLimit)[places] - margin
        for joint, low, high in zip(names, lower, upper, strict=True):
            if not low < high:
                raise ControlError(f"joint '{joint}': stops at {low:g} and {high:g} leave no room.")
        greatest = checked(
            np.broadcast_to(acceleration, (len(rows),)), (len(rows),), "acceleration", ControlError
        )
        if np.any(greatest <= 0.0):
            raise ControlError("the greatest acceleration of a joint must be positive.")
        speed = np.abs(np.asarray(robot.model.upperVelocityLimit)[rows])
        return cls(
            joints=names,
            rows=frozen(rows, np.int_),
            position_rows=frozen(places, np.int_),
            lower=frozen(lower),
            upper=frozen(upper),
            speed=frozen(np.where(speed > 0.0, speed, np.inf)),
            acceleration=greatest,
            braking=braking,
            gears=None if braking is None else _gears_of(robot, names, braking),
        )

    def bounds(
        self,
        position: FloatArray,
        velocity: FloatArray,
        step: float,
        strength: tuple[FloatArray, FloatArray] | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest acceleration (k,) of the joints.

        Args:
            position: q (nq,).
            velocity: v (nv,).
            step: time until the next decision [s].
            strength: what the motors can brake, of motion upwards and downwards (k,), see
                `MotorBraking.strength`; None where they can always brake with `acceleration`.
        """
        from_above = from_below = self.acceleration
        if strength is not None:
            from_above = np.minimum(self.acceleration, strength[0])
            from_below = np.minimum(self.acceleration, strength[1])
        q, v = position[self.position_rows], velocity[self.rows]
        up = np.minimum((self.speed - v) / step, _viable(self.upper - q, v, from_above, step))
        down = np.minimum((self.speed + v) / step, _viable(q - self.lower, -v, from_below, step))
        highest = np.clip(up, -self.acceleration, self.acceleration)
        lowest = np.clip(-down, -self.acceleration, self.acceleration)
        return np.minimum(lowest, highest), np.maximum(lowest, highest)


def _gears_of(robot: Robot, joints: tuple[str, ...], braking: MotorBraking) -> IntArray:
    """Return the number of the gear that drives each joint (k,)."""
    braking.check(robot, joints)
    own = serial_gears(robot.transmission)
    return np.asarray(frozen([own[joint] for joint in joints], np.int_))


def _viable(
    distance: FloatArray, speed: FloatArray, braking: FloatArray, step: float
) -> FloatArray:
    """Return the acceleration (k,) towards a stop after which the joint can still stop before it.

    The larger root a of (v + h a)^2 = 2 b (d - h v - h^2 a/2); braking in full where none is left.
    """
    reach = braking * step
    with np.errstate(invalid="ignore"):  # far stops and endless braking: no bound
        root = reach**2 + 8.0 * braking * distance - 4.0 * reach * speed
        viable = (np.sqrt(np.maximum(root, 0.0)) - 2.0 * speed - reach) / (2.0 * step)
    viable = np.where(np.isfinite(viable), viable, np.inf)
    return np.asarray(np.where(root < 0.0, -braking, viable))
