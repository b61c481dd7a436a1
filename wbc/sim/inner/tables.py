"""What the compiled loops know of a plant: named groups of arrays, which are views of two.

A call from Python into a compiled function costs 0.1 us per array, more than the loops of a small
robot do with it. So a plant keeps all its whole numbers in one array and all its other numbers in
another (`packed`), and the loops find their arrays in these (`opened`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Count,
    OutDense,
    OutPlaces,
    OutRow,
    OutTable,
    Table,
    compiled,
    group,
    view,
)
from wbc.sim.tree.tree import Tree


class Obstacles(NamedTuple):
    """Joint limits, contact points and the planes that these may meet.

    Attributes:
        limit_at: (j, 2) entry of q and row of v.
        limit_range: (j, 2) least and greatest value.
        contact_at: (k, 2) joint, and its last row of v.
        contacts: (k, 5) place on the joint (3), radius, friction.
        solids: (s, 4) unit normal and distance of planes from the world's origin.
        tangents: d per contact, one where contact points move in x-z only, else two.
    """

    limit_at: IntArray
    limit_range: FloatArray
    contact_at: IntArray
    contacts: FloatArray
    solids: FloatArray
    tangents: int


class GearTables(NamedTuple):
    """The gears.

    Attributes:
        numbers: (m, 6), columns RATIO to BACKWARD of `program`.
        rows: (m, nv) speed of the motor outputs per v.
    """

    numbers: FloatArray
    rows: FloatArray


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
    gears: GearTables
    placed: PlacedTree
    bounds: FloatArray
    ends: IntArray


TREE = group(Tree, OutTable, OutDense, OutTable, OutRow)
OBSTACLES = group(Obstacles, OutTable, OutDense, OutTable, OutDense, OutDense, Count)
GEARS = group(GearTables, OutDense, OutDense)
PLACED = group(PlacedTree, OutDense, OutDense, OutDense, OutDense, OutDense)
FLIGHT = group(Flight, OutTable, OutDense, OutDense)
OPENED = group(Opened, TREE, FLIGHT, OBSTACLES, GEARS, PLACED, OutRow, OutPlaces)

JOINT, FRAME, FIRST, PLANAR, PLACES = range(5)
"""Columns of a table of free bases: numbers in the tree, first row of v, flag, first entry of q."""

RETURN_SPEED, ACCURACY, DRIFT_FROM, TOUCH = range(4)

_WHOLE = 6
"""Groups keep six arrays of whole numbers, which come first."""

_GEARS = 5
"""Place of the gears' numbers among the other arrays."""


def packed(whole: Sequence[IntArray], numbers: Sequence[FloatArray]) -> tuple[IntArray, FloatArray]:
    """Return two arrays that hold those given, whole numbers (6 arrays) and others, one by one.

    The first begins with where each is: its start, rows and columns.
    """
    heads, start = [], 3 * (len(whole) + len(numbers))
    for table in whole:
        heads += [start, len(table), table.shape[1]]
        start += table.size
    start = 0
    for array in numbers:
        heads += [start, len(array), array.shape[1]]
        start += array.size
    flat = [np.array(heads), *(table.ravel() for table in whole)]
    return (
        np.concatenate(flat).astype(np.int64),
        np.concatenate([array.ravel() for array in numbers]).astype(np.float64),
    )


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
    ends = _table(whole, 5).ravel()
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
        ends[-1],
    )
    return Opened(
        tree,
        Flight(_table(whole, 2), _matrix(whole, numbers, 13), _matrix(whole, numbers, 14)),
        obstacles,
        GearTables(_matrix(whole, numbers, _GEARS), _matrix(whole, numbers, 6)),
        PlacedTree(
            _matrix(whole, numbers, 8),
            _matrix(whole, numbers, 9),
            _matrix(whole, numbers, 10),
            _matrix(whole, numbers, 11),
            _matrix(whole, numbers, 12),
        ),
        _matrix(whole, numbers, 7).ravel(),
        ends[:-1],
    )


def losses_of(whole: IntArray, numbers: FloatArray) -> FloatArray:
    """Return the columns 1/eta_f and eta_b of a plant's gears, (m, 2), as a view."""
    head = 3 * (_WHOLE + _GEARS)
    start, rows, columns = whole[head : head + 3].tolist()
    return numbers[start : start + rows * columns].reshape(rows, columns)[:, -2:]


@compiled(OutRow, Table, OutDense)
def point_of_reference(bases: IntArray, poses: FloatArray) -> FloatArray:
    """Return the point (3,) of all spatial vectors: the first free base, or the first joint."""
    joint = bases[0, FRAME] if len(bases) else 0
    found: FloatArray = poses[joint, 9:]
    return found


def packed_plant(
    tree: Tree,
    bases: IntArray,
    obstacles: Obstacles,
    gears: GearTables,
    bounds: Sequence[float],
    ends: IntArray,
) -> tuple[IntArray, FloatArray]:
    """Return a plant's numbers and room to work in as two arrays, see `opened`."""
    n, nv = len(tree.joints), len(tree.rows)
    # Poses, columns, bodies, bodies with all behind them, H_l, momenta, frames of bases.
    widths = (n, 12), (nv, 6), (n, 10), (n, 10), (nv, nv), (len(bases), 10), (len(bases), 12)
    last = np.append(ends, obstacles.tangents)
    return packed(
        (tree.joints, tree.rows, bases, obstacles.limit_at, obstacles.contact_at, last[None]),
        (
            tree.shapes,
            tree.gravity[None],
            obstacles.limit_range,
            obstacles.contacts,
            obstacles.solids,
            gears.numbers,
            gears.rows,
            np.array([bounds]),
            *(np.zeros(shape) for shape in widths),
        ),
    )
