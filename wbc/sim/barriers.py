"""What can be reached but not passed: joint limits and the ground under the contact points."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics import Workspace
from wbc.mechanics.tree import Tree
from wbc.robot import Hull, Robot
from wbc.sim.body_pairs import pairs_of, tables_of
from wbc.sim.ground import Terrain

TOUCH = 1e-6
"""Gap [m, rad] up to which a barrier counts as closed."""

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Barriers:
    """The joint limits and contact points of a robot on a terrain: constant numbers and names.

    Attributes:
        limits: 2 j, lower limits, then upper ones, of j joints.
        points: k contact points.
        pairs: names of p pairs of hulls.
        contacts: c contact barriers, all points for the first of s solids first, then the pairs'.
        bodies: the pairs as arrays.
        size: 2 j + c.
        tangents: per contact, one where no contact point can leave its x-z plane, else two.
        asked: whether only Python knows how far some of the ground is.
        names: of the barriers (2 j + c).
    """

    def __init__(
        self, robot: Robot, terrain: Terrain, space: Workspace, tree: Tree, hulls: tuple[Hull, ...]
    ) -> None:
        """Collect the finite limits and prepare the contacts.

        Args:
            robot: with all points that touch the ground.
            terrain: what they touch.
            space: of the robot.
            tree: of the robot.
            hulls: of its links that meet edges of the ground, and each other.
        """
        model = robot.model
        low, high = _finite(model.lowerPositionLimit), _finite(model.upperPositionLimit)
        single = [
            (name, joint)
            for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True)
            if joint.nq == 1
            and joint.nv == 1
            and (np.isfinite(low[joint.idx_q]) or np.isfinite(high[joint.idx_q]))
        ]
        self._space, self._solids = space, terrain.solids
        self.asked = any(solid.numbers() is None for solid in terrain.solids)
        at = [(joint.idx_q, joint.idx_v) for _, joint in single]
        self._at = np.array(at, dtype=np.int64).reshape(-1, 2)
        self._range = np.column_stack((low[self._at[:, 0]], high[self._at[:, 0]]))
        both, pairs = pairs_of(hulls, robot.surface, terrain)
        self.bodies = tables_of(both, pairs, robot.surface, tree, len(robot.contacts))
        self.pairs = tuple((both[a].name, both[b].name) for a, b, *_ in pairs)
        self.tangents = 1 if _moves_in_plane(space) and not pairs else 2
        self.limits, self.points = 2 * len(single), len(robot.contacts)
        self.contacts = self.points * len(terrain.solids) + len(self.bodies.slots)
        self.size = self.limits + self.contacts
        self.names = (
            *(f"joint '{name}' at its lower limit" for name, _ in single),
            *(f"joint '{name}' at its upper limit" for name, _ in single),
            *(f"contact '{c.name}'" for c in robot.contacts * len(terrain.solids)),
            *(f"'{a}' on '{b}'" for a, b in (self.pairs[i] for i in self.bodies.slots[:, 0])),
        )

    def tables(self, tree: Tree) -> tuple[IntArray, FloatArray, IntArray, FloatArray]:
        """Return limits and contact points as the first tables of `Obstacles`."""
        frames = [self._space.model.frames[number] for number in self._space.frames]
        last = {int(joint): row for row, (joint, _) in enumerate(tree.rows)}
        at = [(frame.parentJoint - 1, last.get(frame.parentJoint - 1, -1)) for frame in frames]
        own = [
            (*frame.placement.translation, contact.radius, contact.friction)
            for frame, contact in zip(frames, self._space.robot.contacts, strict=True)
        ]
        contact_at = np.array(at, dtype=np.int64).reshape(-1, 2)
        return self._at, self._range, contact_at, np.reshape(own, (-1, 5))

    def gaps_of(self, points: FloatArray) -> FloatArray:
        """Return the gaps (k,) of points (k, 3) [m], world, from the nearest ground."""
        gaps = [solid.gap(points)[0] for solid in self._solids]
        return gaps[0] if len(gaps) == 1 else np.asarray(np.min(gaps, axis=0))

    def within_limits(self, position: FloatArray) -> FloatArray:
        """Return q (nq,) with every joint within its limits."""
        q = np.array(position)
        q[self._at[:, 0]] = np.clip(q[self._at[:, 0]], *self._range.T)
        return q


def _finite(limits: FloatArray) -> FloatArray:
    """Return limits with pinocchio's way of saying "none" (the largest double) as infinity."""
    values = np.array(limits)
    return np.where(np.abs(values) > 1e18, np.copysign(np.inf, values), values)


def _moves_in_plane(space: Workspace) -> bool:
    """Return whether no contact point can leave its x-z plane, whatever the configuration."""
    model, data = space.model, space.data
    generator = np.random.default_rng(0)
    for _ in range(3):
        q = pin.integrate(model, pin.neutral(model), generator.uniform(-1.0, 1.0, model.nv))
        pin.computeJointJacobians(model, data, q)
        for frame in space.frames:
            pin.updateFramePlacement(model, data, frame)
            whole = pin.getFrameJacobian(model, data, frame, _WORLD).reshape(6, -1)
            if np.abs(whole[[1, 3, 5]]).max() > 1e-9:
                return False
    return True
