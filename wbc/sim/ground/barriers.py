"""What can be reached but not passed: joint limits and the ground under the contact points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.dynamics import Workspace
from wbc.robot import Robot
from wbc.sim.ground.contact_rows import ContactRows, contact_points, contact_rows, moves_in_plane
from wbc.sim.ground.terrain import Terrain
from wbc.sim.step.program import Unilateral

TOUCH = 1e-6
"""Gap [m, rad] up to which a barrier counts as closed."""

_NONE = np.zeros(0, dtype=np.int_)
_NOWHERE = (np.zeros(0), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False, slots=True)
class Clearance:
    """Distances at one configuration.

    Attributes:
        gap: (2 j + k,) to the lower limits, the upper limits, and of the contact points.
        normal: (k, 3) out of the ground at each contact point.
    """

    gap: FloatArray
    normal: FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class ClosedRows:
    """The rows of the barriers that are closed.

    Attributes:
        unilateral: their laws.
        limits: (l,) indices of the closed joint limits.
        which: (c,) indices of the closed contacts.
    """

    unilateral: Unilateral
    limits: IntArray
    which: IntArray


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
        forward = np.zeros((len(single), model.nv))
        forward[np.arange(len(single)), self._velocity] = 1.0
        self._turning = np.concatenate((forward, -forward))
        self.planar = moves_in_plane(space)
        self.limits = 2 * len(single)
        self.contacts = len(robot.contacts)

    @property
    def size(self) -> int:
        """2 j + k."""
        return self.limits + self.contacts

    def clearance(self, position: FloatArray) -> Clearance:
        """Return all gaps at q (nq,), for the placements held in the workspace."""
        gap, normal = self._terrain.gap(contact_points(self._space)) if self.contacts else _NOWHERE
        if self.limits:
            here = position[self._position]
            gap = np.concatenate((here - self._lower, self._upper - here, gap))
        return Clearance(gap, normal)

    def contact_rows(self, clearance: Clearance) -> ContactRows:
        """Return the rows of all contacts, for the Jacobians held in the workspace."""
        return contact_rows(self._space, clearance.normal, self.planar)

    def approach(self, contacts: ContactRows, velocity: FloatArray) -> FloatArray:
        """Return how fast every gap opens (2 j + k,) at v (nv,)."""
        leaving = contacts.rows[:, 0] @ velocity
        if not self.limits:
            return leaving
        turning = velocity[self._velocity]
        return np.concatenate((turning, -turning, leaving))

    def closed_rows(
        self, closed: BoolArray, contacts: ContactRows, target: FloatArray
    ) -> ClosedRows:
        """Return the rows of the closed barriers.

        Args:
            closed: (2 j + k,).
            contacts: rows of all contacts.
            target: (2 j + k,) lowest speed at which each gap may open.
        """
        limits, turning = _NONE, self._turning
        which = closed[self.limits :].nonzero()[0]
        rows = contacts.rows[which]
        if self.limits:
            limits = closed[: self.limits].nonzero()[0]
            turning = turning[limits]
        tangents = rows[:, 1:].reshape(-1, self._nv)
        unilateral = Unilateral(
            turning, rows[:, 0], tangents, self._friction[which], target[closed]
        )
        return ClosedRows(unilateral, limits, which)


def _finite(limits: FloatArray) -> FloatArray:
    """Return limits with pinocchio's way of saying "none" (the largest double) as infinity."""
    values = np.array(limits)
    return np.where(np.abs(values) > 1e18, np.copysign(np.inf, values), values)
