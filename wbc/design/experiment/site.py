"""What every motion of a search shares: rivals, limits and length; motions as large as allowed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.design.experiment.fourier import FourierPath
from wbc.design.experiment.limits import MotionLimits
from wbc.design.experiment.rivals import Predictions, Rivals
from wbc.errors import DesignError
from wbc.robot import Motion

ROOM = 0.8
"""Share of the limits that a motion may use: room for what the rivals do not know."""
SEARCH_RATE = 50.0
"""[Hz] at which motions are compared; odds are given at the rate of the log."""


@dataclass(frozen=True, eq=False)
class Site:
    """What every motion of a search shares.

    Attributes:
        rivals: what is to be told apart.
        limits: what the motions stay inside, to `ROOM`.
        duration: [s].
    """

    rivals: Rivals
    limits: MotionLimits
    duration: float

    def motion(self, path: FourierPath, rate: float) -> Motion:
        """Return the path as a motion of the whole robot, its base held, at `rate` [Hz]."""
        robot = self.rivals.robot
        time = path.times(rate)
        q, v, a = path.at(time)
        pose = robot.pose() if robot.poses else robot.neutral()
        position = np.tile(pose, (len(q), 1))
        position[:, robot.actuated_position] = q
        velocity, acceleration = np.zeros((2, len(q), robot.model.nv))
        velocity[:, robot.actuated], acceleration[:, robot.actuated] = v, a
        return Motion(position, velocity, acceleration, time)

    def require_stillness(self) -> None:
        """Check that the motors hold the robot where motions start and end, whatever is true.

        Raises:
            DesignError: they do not, so that no motion, however small, is within the limits.
        """
        nothing = np.zeros((len(self.limits.center), 1))
        still = FourierPath(self.limits.center, nothing, nothing, 1.0, 2.0 / SEARCH_RATE)
        peak = self.rivals.predictions(self.motion(still, SEARCH_RATE)).peak()
        share = peak.max(axis=0) / self.limits.torque
        if share.max() >= ROOM:
            joint = self.rivals.robot.transmission.joints[int(share.argmax())]
            raise DesignError(
                f"in the pose where motions start, holding still takes {100.0 * share.max():.0f} % "
                f"of the torque limit of '{joint}'; a planned motion may use {100.0 * ROOM:.0f} %. "
                "Name another pose first in robot.toml, or check torque_limit and gear_ratio."
            )

    def each_within(self, path: FourierPath) -> FourierPath:
        """Return the path with every joint that breaks a limit of its own made smaller, alone.

        So one joint that reaches its limit does not hold back the others.
        """
        used = self.limits.joint_shares(path.at(path.times(SEARCH_RATE)))
        return path.scaled(np.minimum(1.0, 0.97 * ROOM / np.maximum(used, 1e-300)))

    def fitted(self, path: FourierPath) -> tuple[FourierPath, Predictions, float]:
        """Return the path made as large as the limits allow, and its predictions.

        Torque does not grow in proportion to the size: the scale is found in a few rounds, and a
        path that breaks a limit is made smaller.
        """
        for _ in range(6):
            found = self.rivals.predictions(self.motion(path, SEARCH_RATE))
            motion = path.at(path.times(SEARCH_RATE))
            used = self.limits.used(motion, found.peak())
            if 0.9 * ROOM <= used <= ROOM:
                break
            path = path.scaled(0.97 * ROOM / used)
        while used > ROOM or not self.limits.keeps_apart(path.at(path.times(SEARCH_RATE))[0]):
            path = path.scaled(0.9)
            found = self.rivals.predictions(self.motion(path, SEARCH_RATE))
            used = self.limits.used(path.at(path.times(SEARCH_RATE)), found.peak())
        return path, found, used
