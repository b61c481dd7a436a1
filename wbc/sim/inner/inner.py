"""A plant's constant numbers and memory as plain arrays, and one part of a step on them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.robot import Robot
from wbc.sim.ground.barriers import TOUCH, Barriers
from wbc.sim.ground.plane import Plane
from wbc.sim.ground.terrain import Terrain
from wbc.sim.inner.motion import to_middle
from wbc.sim.inner.part import FAILED, LANDED, from_middle
from wbc.sim.laws.drivetrain import Drivetrain
from wbc.sim.solve.solver import TOLERANCE
from wbc.sim.state import SimState
from wbc.sim.step.flight import FreeBase
from wbc.sim.step.forces import EffectForces
from wbc.sim.step.overlap import DRIFT
from wbc.sim.step.warm_start import ImpulseLayout
from wbc.sim.tree.tree import Tree, tree_of

_NOTHING = np.zeros(0)


class Ended(NamedTuple):
    """Where a part ended.

    Attributes:
        position: q (nq,).
        velocity: v (nv,).
        gap: (2 j + c,).
        closed: (2 j + c,) barriers that stay closed.
        impulse: of the rows, in the plant's layout.
        after: v (nv,) at the middle, after forces and impulses.
        motor_speed: (m,).
        contact_impulse: (k, 3).
        mesh: (m,) impulse.
        overlap: (2 j + c,) depth left to take back, empty for none.
        landed: whether a barrier that is not closed is passed.
        iterations: linear systems solved.
    """

    position: FloatArray
    velocity: FloatArray
    gap: FloatArray
    closed: BoolArray
    impulse: FloatArray
    after: FloatArray
    motor_speed: FloatArray
    contact_impulse: FloatArray
    mesh: FloatArray
    overlap: FloatArray
    landed: bool
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
        n, nv, k = len(tree.joints), len(tree.rows), barriers.points
        gears = (drive.ratio, drive.inertia, drive.viscous, drive.coulomb, 1.0 / drive.forward)
        table = np.ascontiguousarray(np.column_stack((*gears, drive.backward)))
        self._tree = tree.joints, tree.shapes, tree.rows
        self._fixed = (
            *self._tree,
            tree.gravity,
            bases,
            *barriers.tables(tree),
            solids,
            barriers.planar,
            table,
            drive.rows,
        )
        self._limits = return_speed, TOLERANCE, DRIFT, TOUCH
        self._bases, self._actuated, self._direct = bases, drive.actuated, drive.direct
        # Poses, columns, bodies, bodies with all behind them, H_l.
        widths = (n, 12), (nv, 6), (n, 10), (n, 10), (nv, nv)
        self._memory = tuple(np.zeros(shape) for shape in widths)
        self._carried = np.zeros((len(bases), 10))
        self._dry, m, size = drive.zero, drive.size, barriers.size
        self._sizes = nq, nv, size, stored, nv, m, 3 * k, m, size, 1

    def to_middle(self, state: SimState, half: float) -> tuple[FloatArray, FloatArray]:
        """Return q (nq,) and v (nv,) after `half` a step [s]; the memory then stands there."""
        q, v = state.position, state.velocity
        middle, speed = np.empty(len(q)), np.empty(len(v))
        to_middle(*self._tree, self._bases, q, v, half, *self._memory, self._carried, middle, speed)
        return middle, speed

    def from_middle(
        self,
        state: SimState,
        position: FloatArray,
        velocity: FloatArray,
        forces: EffectForces,
        external: FloatArray | None,
        kept: BoolArray,
        step: float,
    ) -> Ended | None:
        """Return the end of the part whose middle `to_middle` found; None where Newton fails.

        Args:
            state: at its start.
            position: q (nq,) in the middle.
            velocity: v (nv,) there.
            forces: of the effects there.
            external: (nv,), None for none.
            kept: (2 j + c,) barriers that may close within the part.
            step: h [s].
        """
        dry = self._dry
        if forces.friction is not None:
            dry = forces.friction[self._actuated]
            if not self._direct or np.count_nonzero(forces.friction) != np.count_nonzero(dry):
                return None
        force = forces.joint if external is None else forces.joint + external
        parts = [np.empty(size) for size in self._sizes]
        q, v, gap, impulse, after, motor, push, mesh, overlap, count = parts
        closed, contact = np.empty(len(kept), dtype=bool), push.reshape(-1, 3)
        result = from_middle(
            *self._fixed, state.closed, kept, state.impulse, state.velocity, forces.rotor, force,
            dry, step, *self._limits, *self._memory, self._carried, position, velocity, q, v, gap,
            closed, impulse, after, motor, contact, mesh, overlap, count,
        )  # fmt: skip
        if result == FAILED:
            return None
        left = overlap if result < 0 else _NOTHING
        landed = abs(result) == LANDED
        return Ended(
            q, v, gap, closed, impulse, after, motor, contact, mesh, left, landed, int(count[0])
        )


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
