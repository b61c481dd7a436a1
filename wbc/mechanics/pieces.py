"""The system of the rows' pieces, solved in impulses or, where rows are many, in velocities.

With W'W the compliance of the rows, W (n, r), the pieces are (S W'W + C) x = b; S and C couple a
row with none but those of its own contact. With y = W x,

    x = C^-1 (b - S W' y),    (1 + W C^-1 S W') y = W C^-1 b,

which is n equations instead of r. A row that is held has C = 0: it gets the small spring with which
a split of forces that is left open is chosen, and what that leaves is taken back in rounds.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, compiled, inner
from wbc.mechanics.linear import add_times, copy_to, dot, factor, solve_factored
from wbc.mechanics.rows import RowSystem

_ROUNDS = 3
"""The spring leaves 1e-9 of a row's speed and rounding 1e-7 of its impulse; each round takes off
as much again. Fewer left stances of 120 rows short of 1e-10, more changed nothing."""


@inner
def blocks_of(
    system: RowSystem,
    pieces: Dense,
    sliding: Dense,
    impulse: Row,
    on_speed: OutDense,
    on_impulse: OutDense,
    missing: OutRow,
) -> None:
    """Write S and C (r, 3) row by row, and b (r,).

    They stand on the row itself, or on the normal of its contact, and on the contact's tangents.
    The spring is not in C. A tangent that slides pushes by p_t = (mu p_n + grip) direction, and its
    direction turns with the slip. What it misses was taken at the projected normal impulse; the
    piece is linear in p_n.

    Args:
        system: of the rows.
        pieces, sliding: see `pieces_at`.
        impulse: (r,) of the point of the pieces.
        on_speed, on_impulse, missing: to write.
    """
    frictions, tangents = system.frictions, system.tangents
    size, contacts = len(pieces), len(frictions)
    first = size - contacts * tangents
    on_speed[:], on_impulse[:] = 0.0, 0.0
    for i in range(size):
        missing[i] = pieces[i, 2]
    for i in range(first):
        on_speed[i, 0], on_impulse[i, 0] = pieces[i, 0], pieces[i, 1]
    for contact in range(contacts):
        turning, normal = sliding[contact, 2], first - contacts + contact
        for a in range(tangents):
            row, way = first + contact * tangents + a, sliding[contact, a]
            on_speed[row, 1 + a], on_impulse[row, 1 + a] = pieces[row, 0], pieces[row, 1]
            if turning < 0.0:
                continue
            along = frictions[contact] * way
            on_impulse[row, 0] -= along
            missing[row] = along * impulse[normal] - impulse[row] + system.grips[contact] * way
            for b in range(tangents if tangents == 2 else 0):
                turn = turning * ((1.0 if a == b else 0.0) - way * sliding[contact, b])
                on_impulse[row, 1 + b] -= turn
                on_speed[row, 1 + b] += system.slope[row] * turn


@inner
def times(system: RowSystem, blocks: Dense, given: Dense, result: OutDense) -> None:
    """Write blocks (r, 3) times columns (r, c)."""
    contacts, tangents = len(system.frictions), system.tangents
    first = len(blocks) - contacts * tangents
    result[:] = 0.0
    for i in range(first):
        add_times(blocks[i, 0], given[i], result[i])
    for contact in range(contacts):
        start, normal = first + contact * tangents, first - contacts + contact
        for i in range(start, start + tangents):
            add_times(blocks[i, 0], given[normal], result[i])
            for b in range(tangents):
                add_times(blocks[i, 1 + b], given[start + b], result[i])


@inner
def invert(system: RowSystem, on_speed: Dense, on_impulse: Dense, inverse: OutDense) -> None:
    """Write (C + spring S)^-1 (r, 3), contact by contact.

    A tangent comes after the normal that its friction depends on. The spring holds a piece without
    any slope of its own, too.
    """
    spring, contacts, tangents = system.spring, len(system.frictions), system.tangents
    first = len(inverse) - contacts * tangents
    for i in range(first):
        inverse[i, 0] = 1.0 / (on_impulse[i, 0] + spring[i] * on_speed[i, 0])
    for contact in range(contacts if tangents else 0):
        row, pressed = first + contact * tangents, inverse[first - contacts + contact, 0]
        a = on_impulse[row, 1] + spring[row] * on_speed[row, 1]
        if tangents == 1:
            inverse[row, 0], inverse[row, 1] = -on_impulse[row, 0] * pressed / a, 1.0 / a
            continue
        b = on_impulse[row, 2] + spring[row] * on_speed[row, 2]
        d = on_impulse[row + 1, 1] + spring[row + 1] * on_speed[row + 1, 1]
        e = on_impulse[row + 1, 2] + spring[row + 1] * on_speed[row + 1, 2]
        whole = a * e - b * d
        inverse[row, 1], inverse[row, 2] = e / whole, -b / whole
        inverse[row + 1, 1], inverse[row + 1, 2] = -d / whole, a / whole
        for t in range(row, row + 2):
            rubs = inverse[t, 1] * on_impulse[row, 0] + inverse[t, 2] * on_impulse[row + 1, 0]
            inverse[t, 0] = -rubs * pressed


@inner
def through(ways: Dense, given: Dense, result: OutDense) -> None:
    """Write W x (n, c) of W' (r, n) and columns x (r, c)."""
    result[:] = 0.0
    for i in range(len(ways)):
        for j in range(len(result)):
            if ways[i, j] != 0.0:
                add_times(ways[i, j], given[i], result[j])


@inner
def spread(ways: Dense, given: Row, result: OutDense) -> None:
    """Write W' y (r, 1) of W' (r, n) and y (n,)."""
    for i in range(len(ways)):
        result[i, 0] = dot(given, ways[i])


@compiled(inside=True)
def change_in_velocities(
    system: RowSystem, on_speed: Dense, on_impulse: Dense, missing: Row, change: OutRow
) -> bool:
    """Write the change (r,) of the impulses that solves S W'W x + C x = missing, in velocities."""
    ways = system.ways
    size, n = ways.shape
    inverse, lean, weighted = np.empty((size, 3)), np.empty((size, n)), np.empty((size, n))
    total, pivots, y = np.empty((n, n)), np.empty(n, dtype=np.int64), np.empty((n, 1))
    invert(system, on_speed, on_impulse, inverse)
    times(system, on_speed, ways, lean)
    times(system, inverse, lean, weighted)
    through(ways, weighted, total)
    for j in range(n):
        total[j, j] += 1.0
    if not factor(total, pivots):
        return False
    found, left, flat = np.zeros((size, 1)), np.empty((size, 1)), y.reshape(-1)
    turned, reached, pushed = np.empty((size, 1)), np.empty((size, 1)), np.empty((size, 1))
    for _ in range(_ROUNDS):
        through(ways, found, y)
        spread(ways, flat, turned)
        times(system, on_speed, turned, reached)
        times(system, on_impulse, found, pushed)
        for i in range(size):
            left[i, 0] = missing[i] - reached[i, 0] - pushed[i, 0]
        times(system, inverse, left, pushed)
        through(ways, pushed, y)
        solve_factored(total, pivots, flat)
        spread(weighted, flat, turned)
        for i in range(size):
            found[i, 0] += pushed[i, 0] - turned[i, 0]
    copy_to(found.reshape(-1), change)
    return True


@inner
def system_in_impulses(
    system: RowSystem, on_speed: Dense, on_impulse: Dense, held: OutRow, total: OutDense
) -> None:
    """Write S W'W + C (r, r) with the spring, and what the spring holds (r,), see `blocks_of`."""
    delassus, contacts, tangents = system.delassus, len(system.frictions), system.tangents
    size = len(held)
    first = size - contacts * tangents
    for i in range(size):
        contact = (i - first) // tangents if i >= first else 0
        start, own = first + contact * tangents, 0 if i < first else 1 + (i - first) % tangents
        share = on_speed[i, own]
        held[i] = system.spring[i] * share
        for j in range(size):
            total[i, j] = share * delassus[i, j]
        total[i, i] += held[i]
        total[i, i if i < first else first - contacts + contact] += on_impulse[i, 0]
        for b in range(tangents if i >= first else 0):
            share, at = on_speed[i, 1 + b], start + b
            total[i, at] += on_impulse[i, 1 + b]
            if at != i and share != 0.0:
                for j in range(size):
                    total[i, j] += share * delassus[at, j]


@compiled(inside=True)
def solve_pieces(
    system: RowSystem, pieces: Dense, sliding: Dense, impulse: Row, solved: OutRow
) -> bool:
    """Write the row impulses (r,) that solve the pieces; False where they contradict each other.

    Rows that depend on each other (more stuck gears and sticking contacts than the robot has
    freedoms) leave their split open; what is left open stays near `impulse` (r,), the point of the
    pieces. In impulses that is a proximal term, whose effect on the rest a second solve with the
    same factors removes.
    """
    size = len(impulse)
    on_speed, on_impulse, change = np.empty((size, 3)), np.empty((size, 3)), np.empty(size)
    blocks_of(system, pieces, sliding, impulse, on_speed, on_impulse, change)
    if len(system.ways):
        good = change_in_velocities(system, on_speed, on_impulse, change, solved)
        add_times(1.0, impulse, solved)
        return good
    total, pivots, held = np.empty((size, size)), np.empty(size, dtype=np.int64), np.empty(size)
    system_in_impulses(system, on_speed, on_impulse, held, total)
    if not factor(total, pivots):
        return False
    solve_factored(total, pivots, change)
    for i in range(size):
        solved[i] = impulse[i] + change[i]
        held[i] *= change[i]
    solve_factored(total, pivots, held)
    add_times(1.0, held, solved)
    return True
