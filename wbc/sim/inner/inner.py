"""A plant's constant numbers and memory as plain arrays, and one part of a step on them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.robot import Robot
from wbc.sim.ground.barriers import TOUCH, Barriers
from wbc.sim.ground.plane import Plane
from wbc.sim.ground.terrain import Terrain
from wbc.sim.inner.impact import (
    CONTACT,
    HIT,
    MESH,
    ROWS,
    UNSOLVED,
    USED,
    gaps_of,
    impact_at,
)
from wbc.sim.inner.part import FAILED, LANDED, first_half, part_of_step
from wbc.sim.inner.tables import GearTables, Obstacles, losses_of, packed_plant
from wbc.sim.laws.drivetrain import Drivetrain
from wbc.sim.solve.solver import TOLERANCE
from wbc.sim.state import SimState
from wbc.sim.step.flight import FreeBase
from wbc.sim.step.forces import EffectForces
from wbc.sim.step.overlap import DRIFT
from wbc.sim.step.warm_start import ImpulseLayout
from wbc.sim.tree.tree import Tree, tree_of

_NOTHING = np.zeros(0)


class Ended:
    """Where a part ended: slices of one array, cut when asked for.

    Attributes:
        closed: (2 j + c,) barriers that stay closed.
        landed: whether a barrier that is not closed is passed.
        left: whether some overlap is left to take back.
    """

    __slots__ = ("_ends", "_out", "closed", "landed", "left")

    def __init__(
        self, out: FloatArray, ends: tuple[int, ...], closed: BoolArray, landed: bool, left: bool
    ) -> None:
        """Keep what `from_middle` wrote."""
        self._out, self._ends, self.closed = out, ends, closed
        self.landed, self.left = landed, left

    @property
    def position(self) -> FloatArray:
        """q (nq,)."""
        return self._out[: self._ends[0]]

    @property
    def velocity(self) -> FloatArray:
        """v (nv,)."""
        return self._out[self._ends[0] : self._ends[1]]

    @property
    def motor_speed(self) -> FloatArray:
        """(m,) of the motor outputs."""
        return self._out[self._ends[1] : self._ends[2]]

    @property
    def impulse(self) -> FloatArray:
        """Of the rows, in the plant's layout."""
        return self._out[self._ends[2] : self._ends[3]]

    @property
    def gap(self) -> FloatArray:
        """(2 j + c,)."""
        return self._out[self._ends[3] : self._ends[4]]

    @property
    def after(self) -> FloatArray:
        """v (nv,) at the middle, after forces and impulses."""
        return self._out[self._ends[4] : self._ends[5]]

    @property
    def mesh_impulse(self) -> FloatArray:
        """T (m,) [N m s]."""
        return self._out[self._ends[5] : self._ends[6]]

    @property
    def overlap(self) -> FloatArray:
        """(2 j + c,) depth that is left to take back; empty where nothing is."""
        return self._out[self._ends[6] : self._ends[7]] if self.left else _NOTHING

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot, world axes."""
        return self._out[self._ends[7] : self._ends[8]].reshape(-1, 3)

    @property
    def iterations(self) -> int:
        """Linear systems solved."""
        return int(self._out[self._ends[8]])

    @property
    def middle(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """q (nq,), v (nv,) in the middle, and how fast contacts opened at the start (2 j + c,).

        The last is for closed contacts.
        """
        return _middle(self._out, self._ends)


def _middle(out: FloatArray, ends: tuple[int, ...]) -> tuple[FloatArray, FloatArray, FloatArray]:
    return out[ends[9] : ends[10]], out[ends[10] : ends[11]], out[ends[11] : ends[12]]


class Struck(NamedTuple):
    """What barriers that are reached do.

    Attributes:
        kind: APART, RESTING or HIT.
        fresh, closed: (2 j + c,) barriers that are reached, and that are closed afterwards.
        after: v (nv,) after; this and the rest belong to HIT.
        contact_impulse: (k, 3) [N s] on the robot, world axes.
        impulse: (r,) of the rows.
        mesh_loss, contact_loss: [J].
        iterations: linear systems solved.
    """

    kind: int
    fresh: BoolArray
    closed: BoolArray
    after: FloatArray
    contact_impulse: FloatArray
    impulse: FloatArray
    mesh_loss: float
    contact_loss: float
    iterations: int


class Inner:
    """The compiled inner work of one plant, with the memory that it works in."""

    def __init__(
        self,
        tree: Tree,
        bases: IntArray,
        drive: Drivetrain,
        barriers: Barriers,
        solids: FloatArray,
        return_speed: float,
        nq: int,
        stored: int,
    ) -> None:
        """Keep what does not change and make room for the rest; see `inner_of`."""
        nv, m, size = len(tree.rows), drive.size, barriers.size
        columns = (drive.ratio, drive.inertia, drive.viscous, drive.coulomb, 1.0 / drive.forward)
        gears = GearTables(np.column_stack((*columns, drive.backward)), drive.rows)
        tangents = 1 if barriers.planar else 2
        obstacles = Obstacles(*barriers.tables(tree), solids, tangents)
        bounds = return_speed, TOLERANCE, DRIFT, TOUCH
        self._most = nv, size, barriers.points, m + size * (1 + tangents)
        sizes = (nq, nv, m, stored, size, nv, m, size, 3 * barriers.points, 1, nq, nv, size)
        ends = np.cumsum(sizes)
        self._ends = tuple(ends.tolist())
        self._packed = packed_plant(tree, bases, obstacles, gears, bounds, ends)
        self._actuated, self._direct = drive.actuated, drive.direct
        self._dry, self._size = drive.zero, self._ends[-1]

    def to_middle(self, state: SimState, half: float) -> FloatArray:
        """Return what a part writes, with its first half written: see `Ended`.

        The memory then stands in the middle, after `half` a step [s].
        """
        q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
        out = np.empty(self._size)
        first_half(*self._packed, q, v, half, state.closed, out)
        return out

    def middle(self, out: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return q (nq,) and v (nv,) in the middle, of what `to_middle` returned."""
        return _middle(out, self._ends)[:2]

    def from_middle(
        self,
        state: SimState,
        out: FloatArray,
        forces: EffectForces,
        external: FloatArray | None,
        kept: BoolArray,
        step: float,
        drive: Drivetrain | None = None,
    ) -> Ended | None:
        """Return the end of the part whose middle `to_middle` found; None where Newton fails.

        Args:
            state: at its start.
            out: what `to_middle` returned.
            forces: of the effects there.
            external: (nv,), None for none.
            kept: (2 j + c,) barriers that may close within the part.
            step: h [s].
            drive: with the efficiencies that the gears have in the part, None for those as ever.
        """
        dry = self._dry
        if forces.friction is not None:
            dry = forces.friction[self._actuated]
            if not self._direct or np.count_nonzero(forces.friction) != np.count_nonzero(dry):
                return None
        force = forces.joint if external is None else forces.joint + external
        acting = forces.rotor, force, dry, step, True
        if drive is None:
            return self._solved(state, out, acting, kept)
        losses = losses_of(*self._packed)
        as_ever = losses.copy()
        losses[:] = np.column_stack((1.0 / drive.forward, drive.backward))
        found = self._solved(state, out, acting, kept)
        losses[:] = as_ever  # impacts, and whatever comes next
        return found

    def part(
        self,
        state: SimState,
        forces: EffectForces,
        external: FloatArray | None,
        kept: BoolArray,
        step: float,
    ) -> Ended | None:
        """Return the end of a part whose forces do not depend on its middle, like `from_middle`."""
        force = forces.joint if external is None else forces.joint + external
        acting = forces.rotor, force, self._dry, step, False
        return self._solved(state, np.empty(self._size), acting, kept)

    def gaps(self, position: FloatArray) -> FloatArray:
        """Return all gaps (2 j + c,) at q (nq,)."""
        gap = np.empty(self._most[1])
        gaps_of(*self._packed, np.ascontiguousarray(position), gap)
        return gap

    def impact(self, state: SimState, slow: float) -> Struck | None:
        """Return the impact on barriers that have just been reached; None where Newton fails.

        It has no restitution.

        Args:
            state: whose `closed` barriers are known.
            slow: speed up to which barriers that part stay closed.
        """
        n, size, points, rows = self._most
        fresh, closed = np.empty((2, size), dtype=np.bool_)
        after, pushes, impulse, found = (
            np.empty(n),
            np.empty(3 * points),
            np.empty(rows),
            np.empty(4),
        )
        q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
        written: tuple[Any, ...] = after, pushes, impulse, found, fresh, closed
        kind = impact_at(*self._packed, state.closed, q, v, slow, *written)
        if kind == UNSOLVED:
            return None
        count = int(found[ROWS]) if kind == HIT else 0
        solved = pushes.reshape(-1, 3), impulse[:count], float(found[MESH]), float(found[CONTACT])
        return Struck(kind, fresh, closed, after, *solved, int(found[USED]) if count else 0)

    def _solved(
        self, state: SimState, out: FloatArray, acting: tuple[Any, ...], kept: BoolArray
    ) -> Ended | None:
        closed = np.empty(len(kept), dtype=np.bool_)
        q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
        before = state.closed, kept, state.impulse, q, v
        arguments: tuple[Any, ...] = (*self._packed, *before, *acting, out, closed)
        result = part_of_step(*arguments)
        if result == FAILED:
            return None
        return Ended(out, self._ends, closed, abs(result) == LANDED, result < 0)


def inner_of(
    robot: Robot,
    terrain: Terrain,
    bases: tuple[FreeBase, ...],
    drive: Drivetrain,
    barriers: Barriers,
    layout: ImpulseLayout,
    return_speed: float,
) -> Inner | None:
    """Return the compiled inner work of a plant, None where the loops do not know its case.

    They know trees of revolute, prismatic and free joints, rigid gears that are not self-locking,
    rotors that feel their own spin alone, and ground of planes.

    Args:
        robot: what moves.
        terrain: what it stands on.
        bases: its free bases.
        drive: its gears.
        barriers: its limits and contacts.
        layout: of the row impulses between steps.
        return_speed: at which an overlap is taken back at most.
    """
    tree = tree_of(robot.model)
    flat = [solid for solid in terrain.solids if isinstance(solid, Plane)]
    if (
        tree is None
        or len(flat) != len(terrain.solids)
        or drive.any_loose
        or robot.rotors_turn_with_links
        or drive.backward.min(initial=0.0) < 0.0
        or (barriers.points and barriers.tables(tree)[2].min() < 0)
    ):
        return None
    table = [
        (
            base.joint - 1,
            base.frame - 1,
            base.first,
            int(base.planar),
            int(base.places[0]),
        )
        for base in bases
    ]
    solids = np.array([(*plane.normal, plane.height * plane.normal[2]) for plane in flat])
    numbers = np.array(table, dtype=np.int64).reshape(-1, 5)
    flat_ground = solids.reshape(-1, 4)
    nq, stored = robot.model.nq, layout.size
    return Inner(tree, numbers, drive, barriers, flat_ground, return_speed, nq, stored)
