"""What the compiled loops know of a plant: named groups of arrays, which are views of two.

A call from Python into a compiled function costs 0.1 us per array, more than the loops of a small
robot do with it. So a plant keeps all its whole numbers in one array and all its other numbers in
another (`packed_plant`), and the loops find their arrays in these (`opened`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Count,
    Flag,
    OutDense,
    OutPlaces,
    OutRow,
    OutTable,
    Table,
    compiled,
    group,
    view,
)
from wbc.mechanics.tree import Tree


class Obstacles(NamedTuple):
    """Joint limits, contact points, and the solids that these may meet; c = points times solids.

    Attributes:
        limit_at: (j, 2) entry of q and row of v.
        limit_range: (j, 2) least and greatest value.
        contact_at: (k, 2) joint (-1 for the world), and its last row of v (-1).
        contacts: (k, 5) place on the joint (3), radius, friction.
        solids: (s, w) see `solid_gap`; empty where Python knows the ground alone.
        points: (k, 3) memory: places of the contact points, world.
        touch: (c, 7) memory: gap, normal out of the solid (3), and where the point touches (3).
        ground: (c, 3) memory: speed of the ground where they touch, world.
        tangents: d per contact, one where contact points move in x-z only, else two.
        moving: whether any ground moves.
        asked: address of a function of Python that fills `touch` and `ground`, see `Ground`.
    """

    limit_at: IntArray
    limit_range: FloatArray
    contact_at: IntArray
    contacts: FloatArray
    solids: FloatArray
    points: FloatArray
    touch: FloatArray
    ground: FloatArray
    tangents: int
    moving: bool
    asked: int


RATIO, INERTIA, VISCOUS, COULOMB, INVERSE, BACKWARD, STIFFNESS, DAMPING, PLAY = range(9)
"""Columns of gears: N, N^2 I_r, N^2 and |N| times the friction, 1/eta_f, eta_b, flanks."""
DEFLECTION, SPEED = range(2)
"""Columns of the motion of motor outputs: ahead of the joint [rad], and their own [rad/s]."""


class Gears(NamedTuple):
    """The gears.

    Attributes:
        numbers: (m, 9), columns RATIO to PLAY.
        rows: (m, nv) speed of the joints per v, as the motor outputs turn where gears are rigid.
        at: (m, 2) row of v of each joint, and whether the gear is loose.
        motion: (m, 2) memory: columns DEFLECTION and SPEED, of loose gears.
        coupling: (m, nv) memory: N C, see `StepCoupling`; empty where rotors feel their spin alone.
        gyration: (1, nv + m) memory: torques on links and on rotors that come with it.
        direct: whether each gear turns its joint alone and rigidly, so that joint friction and
            gear share a row.
        loose: whether any motor output may leave its joint.
    """

    numbers: FloatArray
    rows: FloatArray
    at: IntArray
    motion: FloatArray
    coupling: FloatArray
    gyration: FloatArray
    direct: bool
    loose: bool


class PlacedTree(NamedTuple):
    """Memory for a tree in one configuration.

    Attributes:
        poses: (n, 12) rotation by rows and place of the joints, world.
        columns: (nv, 6) motion per unit of each row of v.
        bodies: (n, 10) mass, first moment and inertia of each body.
        composite: (n, 10) the same of all behind each joint.
        inertia: H_l (nv, nv).
    """

    poses: FloatArray
    columns: FloatArray
    bodies: FloatArray
    composite: FloatArray
    inertia: FloatArray


class Flight(NamedTuple):
    """The free bases.

    Attributes:
        bases: (b, 5), columns JOINT to PLACES.
        carried: (b, 10) memory: momentum (6), centre of mass (3), and mass of what each carries.
        frames: (b, 12) memory: where the tree stands, rotation of each by rows, and the way (3,)
            from its origin to the centre of mass.
    """

    bases: IntArray
    carried: FloatArray
    frames: FloatArray


class Opened(NamedTuple):
    """All of a plant.

    Attributes:
        tree, flight, obstacles, gears, placed: see there.
        bounds: (4,) at RETURN_SPEED: at which an overlap is taken back at most; ACCURACY: of the
            solution; DRIFT_FROM: overlap from which on it is taken back; TOUCH: gap up to which a
            barrier counts as closed.
        ends: where each part of what a step writes ends, see `Ended`.
    """

    tree: Tree
    flight: Flight
    obstacles: Obstacles
    gears: Gears
    placed: PlacedTree
    bounds: FloatArray
    ends: IntArray


TREE = group(Tree, OutTable, OutDense, OutTable, OutRow)
OBSTACLES = group(Obstacles, OutTable, OutDense, OutTable, *(OutDense,) * 5, Count, Flag, Count)
GEARS = group(Gears, OutDense, OutDense, OutTable, *(OutDense,) * 3, Flag, Flag)
PLACED = group(PlacedTree, *(OutDense,) * 5)
FLIGHT = group(Flight, OutTable, OutDense, OutDense)
OPENED = group(Opened, TREE, FLIGHT, OBSTACLES, GEARS, PLACED, OutRow, OutPlaces)

JOINT, FRAME, FIRST, PLANAR, PLACES = range(5)
"""Columns of a table of free bases: numbers in the tree, first row of v, flag, first entry of q."""

RETURN_SPEED, ACCURACY, DRIFT_FROM, TOUCH = range(4)

_WHOLE = 8
"""How many arrays of whole numbers there are; they come first."""

_GEARS, _MOTION, _COUPLING, _GYRATION, _POINTS, _TOUCH, _GROUND = 6, 8, 9, 10, 11, 12, 13
"""Places of what Python writes or reads between the loops among the other arrays."""


@compiled(OutTable, OutPlaces, Count)
def _table(whole: IntArray, which: int) -> IntArray:
    start, rows, columns = whole[3 * which], whole[3 * which + 1], whole[3 * which + 2]
    found: IntArray = view(whole, start, rows, columns)
    return found


@compiled(OutDense, OutPlaces, OutRow, Count)
def _matrix(whole: IntArray, numbers: FloatArray, which: int) -> FloatArray:
    head = 3 * (_WHOLE + which)
    start, rows, columns = whole[head], whole[head + 1], whole[head + 2]
    found: FloatArray = view(numbers, start, rows, columns)
    return found


@compiled(OPENED, OutPlaces, OutRow)
def opened(whole: IntArray, numbers: FloatArray) -> Opened:
    """Return the arrays of a plant as views of the two that `packed_plant` wrote."""
    options = _table(whole, 7).ravel()
    tree = Tree(
        _table(whole, 0),
        _matrix(whole, numbers, 0),
        _table(whole, 1),
        _matrix(whole, numbers, 1).ravel(),
    )
    obstacles = Obstacles(
        _table(whole, 3),
        _matrix(whole, numbers, 2),
        _table(whole, 4),
        _matrix(whole, numbers, 3),
        _matrix(whole, numbers, 4),
        _matrix(whole, numbers, _POINTS),
        _matrix(whole, numbers, _TOUCH),
        _matrix(whole, numbers, _GROUND),
        options[0],
        options[1] == 1,
        options[2],
    )
    gears = Gears(
        _matrix(whole, numbers, _GEARS),
        _matrix(whole, numbers, 7),
        _table(whole, 5),
        _matrix(whole, numbers, _MOTION),
        _matrix(whole, numbers, _COUPLING),
        _matrix(whole, numbers, _GYRATION),
        options[3] == 1,
        options[4] == 1,
    )
    placed = PlacedTree(
        _matrix(whole, numbers, 14),
        _matrix(whole, numbers, 15),
        _matrix(whole, numbers, 16),
        _matrix(whole, numbers, 17),
        _matrix(whole, numbers, 18),
    )
    flight = Flight(_table(whole, 2), _matrix(whole, numbers, 19), _matrix(whole, numbers, 20))
    bounds, ends = _matrix(whole, numbers, 5).ravel(), _table(whole, 6).ravel()
    return Opened(tree, flight, obstacles, gears, placed, bounds, ends)


def packed_plant(
    tree: Tree,
    bases: IntArray,
    obstacles: Obstacles,
    gears: Gears,
    bounds: tuple[float, ...],
    ends: IntArray,
) -> tuple[IntArray, FloatArray]:
    """Return a plant's numbers and room to work in as two arrays, see `opened`.

    The first begins with where each array is: its start, rows and columns.
    """
    n, nv, b = len(tree.joints), len(tree.rows), len(bases)
    o, g = obstacles, gears
    options = np.array([[o.tangents, o.moving, o.asked, g.direct, g.loose]])
    whole = tree.joints, tree.rows, bases, o.limit_at, o.contact_at, g.at, ends[None], options
    # Poses, columns, bodies, bodies with all behind them, H_l, momenta, frames of bases.
    room = (n, 12), (nv, 6), (n, 10), (n, 10), (nv, nv), (b, 10), (b, 12)
    others = (
        *(tree.shapes, tree.gravity[None], o.limit_range, o.contacts, o.solids),
        np.array([bounds]),
        *(g.numbers, g.rows, g.motion, g.coupling, g.gyration, o.points, o.touch, o.ground),
        *(np.zeros(shape) for shape in room),
    )
    heads, start = [], 3 * (len(whole) + len(others))
    for table in whole:
        heads += [start, *table.shape]
        start += table.size
    start = 0
    for array in others:
        heads += [start, *array.shape]
        start += array.size
    flat = np.concatenate([np.array(heads), *(table.ravel() for table in whole)])
    return flat.astype(np.int64), np.concatenate([a.ravel() for a in others]).astype(np.float64)


class Exchange(NamedTuple):
    """Views of what Python reads and writes between the loops, see `Gears` and `Obstacles`."""

    numbers: FloatArray
    motion: FloatArray
    coupling: FloatArray
    gyration: FloatArray
    points: FloatArray
    touch: FloatArray
    ground: FloatArray

    @classmethod
    def of(cls, whole: IntArray, numbers: FloatArray) -> Exchange:
        """Return the views into a packed plant."""
        found = []
        for which in (_GEARS, _MOTION, _COUPLING, _GYRATION, _POINTS, _TOUCH, _GROUND):
            start, rows, columns = whole[3 * (_WHOLE + which) :][:3].tolist()
            found.append(numbers[start : start + rows * columns].reshape(rows, columns))
        return cls(*found)


@compiled(OutRow, Table, OutDense)
def point_of_reference(bases: IntArray, poses: FloatArray) -> FloatArray:
    """Return the point (3,) of all spatial vectors: the first free base, or the first joint."""
    joint = bases[0, FRAME] if len(bases) else 0
    found: FloatArray = poses[joint, 9:]
    return found
