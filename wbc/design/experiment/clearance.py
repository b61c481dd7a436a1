"""Links that keep apart along a planned motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.robot import Robot, collision_solids

MARGIN = 0.02  # [m] that links keep, as `CollisionLimit` does


@dataclass(frozen=True, eq=False)
class LinkDistances:
    """Pairs of links that must keep a distance.

    Links that a joint joins, and those that are nearer than the margin in the pose about which
    the robot moves, are no pairs: they touch by design.

    Attributes:
        robot: whose links they are.
        solids: with their pairs.
        margin: [m] that is kept between the solids of a pair.
    """

    robot: Robot
    solids: pin.GeometryModel
    margin: float

    @classmethod
    def of(cls, robot: Robot, center: FloatArray, margin: float = MARGIN) -> LinkDistances | None:
        """Return the clearance of a robot, None where its model file holds no pair of solids.

        Args:
            robot: with collision geometry in its URDF or MJCF file.
            center: (m,) of the driven joints, about which it moves.
            margin: [m].
        """
        solids, parents = collision_solids(robot), robot.model.parents
        for i, one in enumerate(solids.geometryObjects):
            for k in range(i + 1, len(solids.geometryObjects)):
                a, b = one.parentJoint, solids.geometryObjects[k].parentJoint
                if a != b and parents[a] != b and parents[b] != a:
                    solids.addCollisionPair(pin.CollisionPair(i, k))
        found = cls(robot, solids, margin)
        near = found._distances(center) < margin
        for pair in [pair for pair, touch in zip(_pairs(solids), near, strict=True) if touch]:
            solids.removeCollisionPair(pair)
        return found if len(solids.collisionPairs) else None

    def keeps(self, positions: FloatArray) -> bool:
        """Whether all pairs stay apart at driven positions (N, m); a free base is held."""
        return not any(map(self._touch, self._whole(positions)))

    def _touch(self, position: FloatArray) -> bool:
        # Fresh data for every row: with those of the row before, coal 3.0.3 starts from its old
        # guess and misses touching links (5 of 300 rows of Solo12, distances wrong by 0.3 m).
        model, near = self.robot.model, self.solids.createData()
        for request in near.collisionRequests:
            request.security_margin = self.margin
        return bool(
            pin.computeCollisions(model, model.createData(), self.solids, near, position, True)
        )

    def least(self, positions: FloatArray) -> float:
        """Return the least distance [m] of any pair at driven positions (N, m)."""
        return float(min(self._distances(row).min() for row in positions))

    def _distances(self, position: FloatArray) -> FloatArray:
        model, data, near = (
            self.robot.model,
            self.robot.model.createData(),
            self.solids.createData(),
        )
        pin.computeDistances(model, data, self.solids, near, self._whole(position[None])[0])
        return np.array([one.min_distance for one in near.distanceResults], dtype=np.float64)

    def _whole(self, positions: FloatArray) -> FloatArray:
        pose = self.robot.pose() if self.robot.poses else self.robot.neutral()
        whole = np.tile(pose, (len(positions), 1))
        whole[:, self.robot.actuated_position] = positions
        return whole


def _pairs(solids: pin.GeometryModel) -> list[pin.CollisionPair]:
    return [pin.CollisionPair(pair.first, pair.second) for pair in solids.collisionPairs]
