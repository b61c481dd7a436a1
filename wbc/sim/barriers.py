"""What can be reached but not passed: joint limits and the ground under the contact points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.dynamics import Workspace
from wbc.robot import Robot
from wbc.sim.ground import ContactRows, contact_points, contact_rows, moves_in_plane
from wbc.sim.program import Unilateral
from wbc.sim.terrain import Terrain

TOUCH = 1e-6
"""Gap [m, rad] up to which a barrier counts as closed."""


@dataclass(frozen=True, eq=False, slots=True)
class Clearance:
    """Distances at one configuration.

    Attributes:
        gap: (2 j + k,) to the lower limits, the upper limits, and of the contact points.
        normal: (k, 3) out of the ground at each contact point.
    """

    gap: FloatArray
    normal: FloatArray


class Barriers:
    """The joint limits and contact points of a robot on a terrain."""

    def __init__(self, robot: Robot, terrain: Terrain, space: Workspace) -> None:
        """Collect the finite limits and prepare the contacts."""
        model = robot.model
        low, high = _finite(model.lowerPositionLimit), _finite(model.upperPositionLimit)
        single = [
            joint
            for joint in list(model.joints)[1:]
            if joint.nq == 1
            and joint.nv == 1
            and (np.isfinite(low[joint.idx_q]) or np.isfinite(high[joint.idx_q]))
        ]
        self._terrain, self._space = terrain, space
        self._position = np.array([joint.idx_q for joint in single], dtype=np.int_)
        self._velocity = np.array([joint.idx_v for joint in single], dtype=np.int_)
        self._lower, self._upper = low[self._position], high[self._position]
        self._friction = np.array([contact.friction for contact in robot.contacts])
        self._nv = model.nv
        self.planar = moves_in_plane(space)
        self.limits = 2 * len(single)
        self.contacts = len(robot.contacts)

    @property
    def size(self) -> int:
        """2 j + k."""
        return self.limits + self.contacts

    def clearance(self, position: FloatArray) -> Clearance:
        """Return all gaps at q (nq,), for the placements held in the workspace."""
        here = position[self._position]
        below, above = here - self._lower, self._upper - here
        if self.contacts == 0:
            return Clearance(np.concatenate((below, above)), np.zeros((0, 3)))
        gap, normal = self._terrain.gap(contact_points(self._space))
        return Clearance(np.concatenate((below, above, gap)), normal)

    def approach(self, normal: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return how fast every gap opens (2 j + k,) at v (nv,), for the held Jacobians."""
        speeds = np.empty(self.size)
        turning = velocity[self._velocity]
        j = len(turning)
        speeds[:j], speeds[j : 2 * j] = turning, -turning
        space, world = self._space, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        for i, frame in enumerate(space.frames):
            jacobian = pin.getFrameJacobian(space.model, space.data, frame, world)
            speeds[2 * j + i] = normal[i] @ (jacobian[:3] @ velocity)
        return speeds

    def rows(
        self, closed: BoolArray, normal: FloatArray, target: FloatArray
    ) -> tuple[Unilateral, ContactRows, IntArray]:
        """Return the rows of the closed barriers, for the held Jacobians.

        Args:
            closed: (2 j + k,).
            normal: (k, 3).
            target: (2 j + k,) lowest speed at which each gap may open.

        Returns:
            the rows, those of contacts with their axes, and the indices (l,) of closed limits.
        """
        limits = np.flatnonzero(closed[: self.limits])
        rows = np.zeros((len(limits), self._nv))
        j = len(self._velocity)
        for i, limit in enumerate(limits):
            rows[i, self._velocity[limit % j]] = 1.0 if limit < j else -1.0
        which = np.flatnonzero(closed[self.limits :])
        contacts = contact_rows(self._space, which, normal[which], self.planar)
        unilateral = Unilateral(
            rows, contacts.normals, contacts.tangents, self._friction[which], target[closed]
        )
        return unilateral, contacts, limits


def _finite(limits: FloatArray) -> FloatArray:
    """Return limits with pinocchio's way of saying "none" (the largest double) as infinity."""
    values = np.array(limits)
    return np.where(np.abs(values) > 1e18, np.copysign(np.inf, values), values)
