"""What can be reached but not passed: joint limits and the ground under the contact points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.dynamics import Workspace
from wbc.robot import Robot
from wbc.sim.ground.contact_rows import ContactRows, contact_points, contact_rows, moves_in_plane
from wbc.sim.ground.terrain import Terrain
from wbc.sim.step.program import Unilateral
from wbc.sim.tree.tree import Tree

TOUCH = 1e-6
"""Gap [m, rad] up to which a barrier counts as closed."""

_NONE = np.zeros(0, dtype=np.int_)
_NOWHERE = (np.zeros(0), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False, slots=True)
class BarrierDistances:
    """Distances at one configuration; c = k s contact barriers, k points times s solids.

    Attributes:
        gap: (2 j + c,) to the lower limits, the upper limits, and of the contact points from the
            solids, all points for the first solid first.
        normal: (c, 3) out of the solid at each contact point.
    """

    gap: FloatArray
    normal: FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class ClosedRows:
    """The rows of some barriers.

    Attributes:
        unilateral: their laws.
        limits: (l,) indices of the joint limits.
        which: (c,) indices of the contact barriers.
        contacts: their rows.
        places: (c, 3) where they touch [m], world; empty where no ground moves.
    """

    unilateral: Unilateral
    limits: IntArray
    which: IntArray
    contacts: ContactRows
    places: FloatArray

    def turning(self, velocity: FloatArray) -> FloatArray:
        """Return the speed (l + c,) of the robot along these rows at v (nv,)."""
        rows = self.unilateral
        return np.concatenate((rows.limits @ velocity, rows.normals @ velocity))

    def approach(self, velocity: FloatArray) -> FloatArray:
        """Return how fast each of these barriers opens (l + c,) at v (nv,)."""
        speed, ground = self.turning(velocity), self.unilateral.ground
        if ground is not None:
            speed[len(self.limits) :] -= ground[: len(self.which)]
        return speed


class Barriers:
    """The joint limits and contact points of a robot on a terrain."""

    def __init__(self, robot: Robot, terrain: Terrain, space: Workspace) -> None:
        """Collect the finite limits and prepare the contacts."""
        model = robot.model
        low, high = _finite(model.lowerPositionLimit), _finite(model.upperPositionLimit)
        single = [
            (name, joint)
            for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True)
            if joint.nq == 1
            and joint.nv == 1
            and (np.isfinite(low[joint.idx_q]) or np.isfinite(high[joint.idx_q]))
        ]
        self._solids, self._space = terrain.solids, space
        self.moving = any(
            solid.velocity(np.zeros((1, 3)), 0.0, 0.0) is not None for solid in self._solids
        )
        self._position = np.array([joint.idx_q for _, joint in single], dtype=np.int_)
        self._velocity = np.array([joint.idx_v for _, joint in single], dtype=np.int_)
        self._lower, self._upper = low[self._position], high[self._position]
        self._radius = np.array([contact.radius for contact in robot.contacts])
        friction = [contact.friction for contact in robot.contacts]
        self._friction = np.tile(np.array(friction), len(self._solids))
        self._nv = model.nv
        forward = np.zeros((len(single), model.nv))
        forward[np.arange(len(single)), self._velocity] = 1.0
        self._turning = np.concatenate((forward, -forward))
        self.planar = moves_in_plane(space)
        self.limits = 2 * len(single)
        self.points = len(robot.contacts)
        self.contacts = self.points * len(self._solids)
        self.names = (
            *(f"joint '{name}' at its lower limit" for name, _ in single),
            *(f"joint '{name}' at its upper limit" for name, _ in single),
            *(f"contact '{c.name}'" for c in robot.contacts * len(self._solids)),
        )

    @property
    def size(self) -> int:
        """2 j + c."""
        return self.limits + self.contacts

    def tables(self, tree: Tree) -> tuple[IntArray, FloatArray, IntArray, FloatArray]:
        """Return limits and contact points as tables for compiled loops, see `gaps_at`."""
        frames = [self._space.model.frames[number] for number in self._space.frames]
        joints = [frame.parentJoint - 1 for frame in frames]
        last = {int(joint): row for row, (joint, _) in enumerate(tree.rows)}
        at = [(joint, last.get(joint, -1)) for joint in joints]
        places = [tuple(frame.placement.translation) for frame in frames]
        friction = self._friction[: self.points]
        own = np.column_stack((np.reshape(places, (-1, 3)), self._radius, friction))
        return (
            np.column_stack((self._position, self._velocity)),
            np.column_stack((self._lower, self._upper)),
            np.array(at, dtype=np.int64).reshape(-1, 2),
            np.ascontiguousarray(own),
        )

    def within_limits(self, position: FloatArray) -> FloatArray:
        """Return q (nq,) with every joint within its limits."""
        q = np.array(position)
        q[self._position] = np.clip(q[self._position], self._lower, self._upper)
        return q

    def clearance(self, position: FloatArray, time: float) -> BarrierDistances:
        """Return all gaps at q (nq,) and a time [s], for the placements held in the workspace."""
        gap, normal = self._ground(time) if self.contacts else _NOWHERE
        if self.limits:
            here = position[self._position]
            gap = np.concatenate((here - self._lower, self._upper - here, gap))
        return BarrierDistances(gap, normal)

    def gaps_of(self, points: FloatArray, time: float) -> FloatArray:
        """Return the gaps (k,) of points (k, 3) [m], world, from the nearest ground at a time."""
        gaps = [solid.at(time).gap(points)[0] for solid in self._solids]
        return np.asarray(np.min(gaps, axis=0))

    def _ground(self, time: float) -> tuple[FloatArray, FloatArray]:
        points = contact_points(self._space)
        if len(self._solids) == 1:
            gap, normal = self._solids[0].at(time).gap(points)
            return gap - self._radius, normal
        found = [solid.at(time).gap(points) for solid in self._solids]
        gaps = np.concatenate([gap - self._radius for gap, _ in found])
        return gaps, np.concatenate([normal for _, normal in found])

    def rows(
        self,
        closed: BoolArray,
        clearance: BarrierDistances,
        target: FloatArray,
        time: float = 0.0,
        later: float = 0.0,
    ) -> ClosedRows:
        """Return the rows of some barriers, for the Jacobians held in the workspace.

        Args:
            closed: (2 j + c,) which.
            clearance: where they are.
            target: (2 j + c,) lowest speed at which each gap may open.
            time: [s] of `clearance`.
            later: [s] at which ground that moves has the speed that speeds are counted from.
        """
        limits, turning = _NONE, self._turning
        which = closed[self.limits :].nonzero()[0]
        contacts = contact_rows(
            self._space,
            which % self.points if self.points else which,
            clearance.normal[which],
            self.planar,
        )
        if self.limits:
            limits = closed[: self.limits].nonzero()[0]
            turning = turning[limits]
        rows = contacts.rows
        tangents = rows[:, 1:].reshape(-1, self._nv)
        unilateral = Unilateral(
            turning, rows[:, 0], tangents, self._friction[which], target[closed]
        )
        if not self.moving:
            return ClosedRows(unilateral, limits, which, contacts, _NOWHERE[1])
        places = contact_points(self._space)[contacts.points]
        places -= self._radius[contacts.points, None] * clearance.normal[which]
        held = ClosedRows(unilateral, limits, which, contacts, places)
        along = self.ground_speed(held, time, later)
        return replace(held, unilateral=replace(unilateral, ground=along))

    def ground_speed(self, held: ClosedRows, time: float, later: float) -> FloatArray | None:
        """Return `Unilateral.ground` for ground as it moves `later`, None where no ground moves."""
        if not self.moving:
            return None
        speed = np.zeros(held.places.shape)
        for number, solid in enumerate(self._solids):
            own = held.which // self.points == number if self.points else held.which == 0
            found = solid.velocity(held.places[own], time, later)
            if found is not None:
                speed[own] = found
        along = np.einsum("cax,cx->ca", held.contacts.axes, speed)
        return np.concatenate((along[:, 0], along[:, 1:].ravel()))


def _finite(limits: FloatArray) -> FloatArray:
    """Return limits with pinocchio's way of saying "none" (the largest double) as infinity."""
    values = np.array(limits)
    return np.where(np.abs(values) > 1e18, np.copysign(np.inf, values), values)
