"""What a motion must stay inside: position, speed, acceleration, rotor torque and collisions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.design.experiment.clearance import LinkDistances
from wbc.errors import DesignError
from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Limits of the driven joints, each (m,); infinite where there is none.

    Attributes:
        low, high: positions [rad, m].
        speed: of the joints [rad/s, m/s].
        acceleration: of the joints [rad/s^2, m/s^2].
        torque: of the rotors [N m].
        center: strictly between `low` and `high`; motions start and end there [rad, m].
        clearance: links that keep apart; None where the model file holds no collision solids.
    """

    low: FloatArray
    high: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    center: FloatArray
    clearance: LinkDistances | None = None

    @classmethod
    def of(
        cls,
        robot: Robot,
        span: float = np.inf,
        speed: float = np.inf,
        acceleration: float = np.inf,
        center: FloatArray | None = None,
    ) -> MotionLimits:
        """Return the robot's own limits, narrowed by what is given.

        Args:
            robot: the robot; its model holds positions and speeds, its motors torque and speed.
            span: furthest from `center` [rad, m].
            speed: of every joint [rad/s, m/s].
            acceleration: of every joint [rad/s^2, m/s^2].
            center: (m,) about which the robot moves; its usual pose when left out, the middle of
                its range where that pose lies at a limit.

        Raises:
            DesignError: a limit that is not positive, position limits that leave no room.
        """
        given = {"span": span, "speed": speed, "acceleration": acceleration}
        for name, value in given.items():
            if not value > 0.0:
                raise DesignError(f"the limit of {name} must be > 0, got {value:g}.")
        gears, rows = robot.transmission, robot.actuated
        pose = robot.pose() if robot.poses else robot.neutral()
        middle = pose[robot.actuated_position] if center is None else center
        # A joint's speed turns several motors in a parallel drive: each bounds it alone.
        per_speed = np.abs(gears.gear_ratio[:, None] * gears.motor_from_joint)
        share = np.where(per_speed > 0.0, per_speed, np.nan)
        with np.errstate(invalid="ignore"):
            own = np.nanmin(gears.speed_limit[:, None] / share, axis=0)
        model = np.asarray(robot.model.velocityLimit)[rows]
        model = np.where(model > 0.0, model, np.inf)
        low = np.asarray(robot.model.lowerPositionLimit)[robot.actuated_position]
        high = np.asarray(robot.model.upperPositionLimit)[robot.actuated_position]
        ranged = high > low
        low, high = np.where(ranged, low, -np.inf), np.where(ranged, high, np.inf)
        inside = (low < middle) & (middle < high)
        with np.errstate(invalid="ignore"):
            middle = np.where(inside, middle, 0.5 * (low + high))
        low, high = np.maximum(low, middle - span), np.minimum(high, middle + span)
        if not np.all((low < middle) & (middle < high)):
            raise DesignError("the position limits leave no room to move.")
        return cls(
            low=low,
            high=high,
            speed=np.minimum(np.minimum(model, own), speed),
            acceleration=np.full(gears.size, acceleration),
            torque=np.array(gears.torque_limit),
            center=middle,
            clearance=LinkDistances.of(robot, middle),
        )

    def used(
        self,
        motion: tuple[FloatArray, FloatArray, FloatArray],
        torque: FloatArray,
    ) -> float:
        """Return the largest share of a limit that a motion uses; above 1 it is broken.

        Args:
            motion: positions, velocities, accelerations (N, m).
            torque: (N, m) [N m] that the motion needs.
        """
        return float(max(self.joint_shares(motion).max(), (np.abs(torque) / self.torque).max()))

    def keeps_apart(self, positions: FloatArray) -> bool:
        """Whether no links come too near one another at driven positions (N, m)."""
        return self.clearance is None or self.clearance.keeps(positions)

    def joint_shares(self, motion: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
        """Return (m,) the largest share of position, speed or acceleration that each joint uses.

        Args:
            motion: positions, velocities, accelerations (N, m).
        """
        q, v, a = motion
        shares = [
            (q - self.center) / (self.high - self.center),
            (self.center - q) / (self.center - self.low),
            np.abs(v) / self.speed,
            np.abs(a) / self.acceleration,
        ]
        return np.asarray(np.max([share.max(axis=0) for share in shares], axis=0))
