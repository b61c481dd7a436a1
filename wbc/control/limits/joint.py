"""How far, how fast and how hard joints may move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray, IntArray, checked, frozen
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False)
class JointLimit:
    """Position, velocity and acceleration limits of joints, as bounds on their accelerations.

    With braking at most b, a joint at distance d from its stop may not be faster than
    sqrt(2 b d); the bound on the acceleration over one step h is the least of

        (v_max - v)/h,   (sqrt(2 b d) - v)/h,   a_max,

    with d taken after the step, so that a joint which keeps it can always stop in time
    (a viable state stays viable, Del Prete 2018). A joint already beyond its stop or too fast
    for it brakes with b at most.

    Attributes:
        joints: names, in the order of the arrays.
        rows: velocity rows (k,) of the joints.
        position_rows: position rows (k,).
        lower, upper: stops (k,) [rad or m].
        speed: greatest speed (k,) [rad/s or m/s].
        acceleration: greatest acceleration (k,), which is also the braking b.
    """

    joints: tuple[str, ...]
    rows: IntArray
    position_rows: IntArray
    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    acceleration: FloatArray

    @classmethod
    def of(
        cls,
        robot: Robot,
        joints: Sequence[str] | None = None,
        *,
        acceleration: float | FloatArray = 100.0,
        margin: float = 0.0,
    ) -> JointLimit:
        """Return the limits that the robot's model states.

        Args:
            robot: the robot.
            joints: names of one-degree joints, all driven ones when left out.
            acceleration: greatest acceleration and braking [rad/s^2], one number or one per joint.
            margin: distance kept from every stop [rad].

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
        braking = checked(
            np.broadcast_to(acceleration, (len(rows),)), (len(rows),), "acceleration", ControlError
        )
        if np.any(braking <= 0.0):
            raise ControlError("the greatest acceleration of a joint must be positive.")
        speed = np.abs(np.asarray(robot.model.upperVelocityLimit)[rows])
        return cls(
            joints=names,
            rows=frozen(rows, np.int_),
            position_rows=frozen(places, np.int_),
            lower=frozen(lower),
            upper=frozen(upper),
            speed=frozen(np.where(speed > 0.0, speed, np.inf)),
            acceleration=braking,
        )

    def bounds(
        self, position: FloatArray, velocity: FloatArray, step: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest acceleration (k,) of the joints.

        Args:
            position: q (nq,).
            velocity: v (nv,).
            step: time until the next decision [s].
        """
        q, v = position[self.position_rows], velocity[self.rows]
        ahead = q + step * v
        up = np.minimum(self.speed, _viable_speed(self.upper - ahead, self.acceleration))
        down = np.minimum(self.speed, _viable_speed(ahead - self.lower, self.acceleration))
        highest = np.clip((up - v) / step, -self.acceleration, self.acceleration)
        lowest = np.clip((-down - v) / step, -self.acceleration, self.acceleration)
        return np.minimum(lowest, highest), np.maximum(lowest, highest)


def _viable_speed(distance: FloatArray, braking: FloatArray) -> FloatArray:
    """Return the speed (k,) from which a joint can still stop within `distance`."""
    return np.sqrt(2.0 * braking * np.maximum(distance, 0.0))
