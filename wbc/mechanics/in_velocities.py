"""The system of the rows' pieces solved in velocities: faster where rows are many.

With W'W the compliance of the rows, W (n, r), the pieces are (S W'W + C) x = b; S and C couple a
row with none but those of its own contact. With y = W x,

    x = C^-1 (b - S W' y),    (1 + W C^-1 S W') y = W C^-1 b,

which is n equations instead of r. A row that is held has C = 0: it gets the small spring with which
a split of forces that is left open is chosen, and what that leaves is taken back in rounds.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, OutPlaces, OutRow, Row, compiled
from wbc.mechanics.linear import dot, factor, solve_factored
from wbc.mechanics.rows import RowSystem

_ROUNDS = 3
"""The spring leaves 1e-9 of a row's speed and rounding 1e-7 of its impulse; each round takes off
as much again. Fewer left stances of 120 rows short of 1e-10, more changed nothing."""


@compiled(counted=False)
def row_blocks(
    slope: Row,
    frictions: Row,
    tangents: int,
    pieces: Dense,
    sliding: Dense,
    on_speed: OutDense,
    on_impulse: OutDense,
) -> None:
    """Write S and C (r, 3), row by row: on the normal or the row itself, and on the two tangents.

    Only a tangent that slides has entries beside its own: `solve_pieces` says which. The spring is
    not in C.
    """
    size, contacts = len(pieces), len(frictions)
    on_speed[:], on_impulse[:] = 0.0, 0.0
    first = size - contacts * tangents
    for i in range(size):
        own = 1 + (i - first) % tangents if i >= first else 0
        on_speed[i, own], on_impulse[i, own] = pieces[i, 0], pieces[i, 1]
    for contact in range(contacts):
        turning = sliding[contact, 2]
        if turning < 0.0:
            continue
        for a in range(tangents):
            row = first + contact * tangents + a
            on_impulse[row, 0] -= frictions[contact] * sliding[contact, a]
            for b in range(tangents if tangents == 2 else 0):
                turn = -sliding[contact, a] * sliding[contact, b] + (1.0 if a == b else 0.0)
                on_impulse[row, 1 + b] -= turning * turn
                on_speed[row, 1 + b] += slope[row] * turning * turn


@compiled(counted=False)
def times(contacts: int, tangents: int, blocks: Dense, given: Row, result: OutRow) -> None:
    """Write S or C (r, 3) times a vector (r,)."""
    size = len(given)
    first = size - contacts * tangents
    for i in range(first):
        result[i] = blocks[i, 0] * given[i]
    for i in range(first, size):
        contact = (i - first) // tangents
        result[i] = blocks[i, 0] * given[first - contacts + contact]
        for b in range(tangents):
            result[i] += blocks[i, 1 + b] * given[first + contact * tangents + b]


@compiled(counted=False)
def undo(
    contacts: int, tangents: int, on_speed: Dense, on_impulse: Dense, spring: Row, columns: OutDense
) -> None:
    """Replace columns (r, c) by (C + spring S)^-1 of them, contact by contact.

    A tangent is solved after the normal that its friction depends on. The spring holds a piece
    without any slope of its own, too.
    """
    size, width = columns.shape
    first = size - contacts * tangents
    for i in range(first):
        own = on_impulse[i, 0] + spring[i] * on_speed[i, 0]
        for c in range(width):
            columns[i, c] /= own
    for contact in range(contacts):
        normal, row = first - contacts + contact, first + contact * tangents
        a = on_impulse[row, 1] + spring[row] * on_speed[row, 1]
        if tangents == 1:
            for c in range(width):
                columns[row, c] = (columns[row, c] - on_impulse[row, 0] * columns[normal, c]) / a
        if tangents != 2:
            continue
        b = on_impulse[row, 2] + spring[row] * on_speed[row, 2]
        d = on_impulse[row + 1, 1] + spring[row + 1] * on_speed[row + 1, 1]
        e = on_impulse[row + 1, 2] + spring[row + 1] * on_speed[row + 1, 2]
        whole = a * e - b * d
        for c in range(width):
            one = columns[row, c] - on_impulse[row, 0] * columns[normal, c]
            two = columns[row + 1, c] - on_impulse[row + 1, 0] * columns[normal, c]
            columns[row, c] = (e * one - b * two) / whole
            columns[row + 1, c] = (a * two - d * one) / whole


@compiled(counted=False)
def gathered(ways: Dense, given: Row, result: OutRow) -> None:
    """Write W x (n,) of W' (r, n) and x (r,)."""
    result[:] = 0.0
    for i in range(len(ways)):
        share = given[i]
        if share != 0.0:
            for j in range(len(result)):
                result[j] += share * ways[i, j]


@compiled(counted=False)
def spread(ways: Dense, given: Row, result: OutRow) -> None:
    """Write W' y (r,) of W' (r, n) and y (n,)."""
    for i in range(len(ways)):
        result[i] = dot(given, ways[i])


@compiled(counted=False)
def factor_in_velocities(
    contacts: int,
    tangents: int,
    ways: Dense,
    on_speed: Dense,
    on_impulse: Dense,
    spring: Row,
    weighted: OutDense,
    total: OutDense,
    pivots: OutPlaces,
) -> bool:
    """Write (C + spring S)^-1 S W' (r, n) and the factors of 1 + W times it; False if singular."""
    size, n = ways.shape
    first = size - contacts * tangents
    for i in range(size):
        for j in range(n):
            weighted[i, j] = on_speed[i, 0] * ways[i, j] if i < first else 0.0
        if i >= first:
            row = i - (i - first) % tangents
            for b in range(tangents):
                share = on_speed[i, 1 + b]
                if share != 0.0:
                    for j in range(n):
                        weighted[i, j] += share * ways[row + b, j]
    undo(contacts, tangents, on_speed, on_impulse, spring, weighted)
    total[:] = 0.0
    for j in range(n):
        total[j, j] = 1.0
    for i in range(size):
        for j in range(n):
            share = ways[i, j]
            if share != 0.0:
                for k in range(n):
                    total[j, k] += share * weighted[i, k]
    return factor(total, pivots)


@compiled
def solve_in_velocities(
    system: RowSystem, pieces: Dense, sliding: Dense, impulse: Row, solved: OutRow
) -> bool:
    """Write the row impulses (r,) that solve the pieces, like `solve_pieces`.

    Args:
        system: with `ways`.
        pieces, sliding, impulse: see `solve_pieces`.
        solved: to write.

    Returns:
        False where the pieces contradict each other.
    """
    ways, spring, slope = system.ways, system.spring, system.slope
    frictions, tangents = system.frictions, system.tangents
    (size, n), contacts = ways.shape, len(frictions)
    on_speed, on_impulse = np.empty((size, 3)), np.empty((size, 3))
    row_blocks(slope, frictions, tangents, pieces, sliding, on_speed, on_impulse)
    weighted, total, pivots = np.empty((size, n)), np.empty((n, n)), np.empty(n, dtype=np.int64)
    factors = ways, on_speed, on_impulse, spring, weighted, total, pivots
    if not factor_in_velocities(contacts, tangents, *factors):
        return False
    missing, reached, change = np.empty(size), np.empty(size), np.zeros(size)
    pushed, turned, y = np.empty(size), np.empty(size), np.empty(n)
    # What the rows miss at `impulse`; a sliding tangent's piece is linear in the normal impulse.
    first = size - contacts * tangents
    for i in range(size):
        solved[i] = pieces[i, 2]
        contact = (i - first) // max(tangents, 1)
        if i >= first and sliding[contact, 2] >= 0.0:
            along = frictions[contact] * sliding[contact, (i - first) % tangents]
            solved[i] = along * impulse[first - contacts + contact] - impulse[i]
            solved[i] += system.grips[contact] * sliding[contact, (i - first) % tangents]
    for _ in range(_ROUNDS):
        gathered(ways, change, y)
        spread(ways, y, turned)
        times(contacts, tangents, on_speed, turned, reached)
        times(contacts, tangents, on_impulse, change, pushed)
        for i in range(size):
            missing[i] = solved[i] - reached[i] - pushed[i]
        undo(contacts, tangents, on_speed, on_impulse, spring, missing.reshape(-1, 1))
        gathered(ways, missing, y)
        solve_factored(total, pivots, y)
        spread(weighted, y, turned)
        for i in range(size):
            change[i] += missing[i] - turned[i]
    for i in range(size):
        solved[i] = impulse[i] + change[i]
    return True
