"""The rows' tangents as one system in the coordinates.

With tangents p = aim - R (u' - u) of the laws at speeds u, impulses change x = ways' p by dx with

    (1 + ways' R ways) dx = ways' (aim - p),

where R couples a row with none but those of its own contact. The links' tree leaves most of the
matrix zero, and elimination from the leaves to the root keeps it so.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, inner
from wbc.mechanics.linear import (
    add_times,
    copy_to,
    dot,
    factor,
    factor_inertia,
    solve_factored,
    solve_inertia,
)
from wbc.mechanics.rows import Room, RowSystem


@inner
def normal_row(system: RowSystem, row: int) -> int:
    """Return the row of the normal that a tangent's friction depends on; any other row itself."""
    d, contacts = system.tangents, len(system.frictions)
    tangents = len(system.free) - contacts * d
    return row if row < tangents else tangents - contacts + (row - tangents) // d


@inner
def stiffened(system: RowSystem, rise: Dense, whole: bool, line: OutRow, total: OutDense) -> None:
    """Write 1 + ways' R ways (n, n), of the rises (r, 3); its lower half, or the whole."""
    d, contacts, (size, n) = system.tangents, len(system.frictions), system.ways.shape
    first, ways = size - contacts * (1 + d), system.ways
    total[:] = 0.0
    for j in range(n):
        total[j, j] = 1.0
    for i in range(size):
        at = normal_row(system, i)
        copy_to(ways[at], line)
        for k in range(n):
            line[k] *= rise[i, 0]
        for b in range(d if at >= first else 0):
            if rise[i, 1 + b] != 0.0:
                add_times(rise[i, 1 + b], ways[first + contacts + (at - first) * d + b], line)
        for j in range(n):
            if ways[i, j] != 0.0:
                end = n if whole else j + 1
                add_times(ways[i, j], line[:end], total[j])


@inner
def same_tangents(room: Room) -> bool:
    """Return whether the tangents rise as those do of which there are factors."""
    for i in range(len(room.aim)):
        for b in range(3):
            if room.known[i, b] != room.rise[i, b]:
                return False
    return True


@inner
def solve_tangents(system: RowSystem, one_sided: bool, room: Room, impulse: Row) -> bool:
    """Write the change of x (n,) to where all tangents hold; False where they contradict.

    Args:
        system: of the rows.
        one_sided: see `tangents_at`.
        room: with aim and rise.
        impulse: (r,) of the point of the tangents.
    """
    change, total = room.change, room.total
    change[:] = 0.0
    for i in range(len(impulse)):
        if room.aim[i] != impulse[i]:
            add_times(room.aim[i] - impulse[i], system.ways[i], change)
    if not same_tangents(room):
        for i in range(len(impulse)):
            copy_to(room.rise[i], room.known[i])
        stiffened(system, room.rise, one_sided, room.line, total)
        room.pivots[0] = -1
        if one_sided or not factor_inertia(total, room.lower):
            for j in range(0 if one_sided else len(total)):
                for k in range(j):
                    total[k, j] = total[j, k]
            for j in range(len(total)):
                copy_to(total[j], room.lower[j])
            if not factor(room.lower, room.pivots):
                room.known[:] = np.nan
                return False
    if room.pivots[0] < 0:
        solve_inertia(room.lower, change)
    else:
        solve_factored(room.lower, room.pivots, change)
    return True


@inner
def follow_tangents(system: RowSystem, room: Room, followed: OutRow) -> None:
    """Write the impulses (r,) of the tangents after the change of x."""
    d, contacts, turning = system.tangents, len(system.frictions), room.turning
    size = len(followed)
    first = size - contacts * (1 + d)
    for i in range(size):
        turning[i] = dot(room.change, system.ways[i])
    for i in range(size):
        at = normal_row(system, i)
        followed[i] = room.aim[i] - room.rise[i, 0] * turning[at]
        for b in range(d if at >= first else 0):
            along = first + contacts + (at - first) * d + b
            followed[i] -= room.rise[i, 1 + b] * turning[along]
