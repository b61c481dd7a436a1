"""The system of the rows' pieces, solved in impulses.

With the compliance of the rows D, the pieces are (S D + C) x = b; S and C couple a row with none
but those of its own contact. A row that is held has C = 0: it gets the small spring with which a
split of forces that is left open is chosen.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, OutRow, Row, compiled, inner
from wbc.mechanics.linear import add_times, factor, solve_factored
from wbc.mechanics.rows import RowSystem


@inner
def put_together(
    system: RowSystem,
    pieces: Dense,
    sliding: Dense,
    impulse: Row,
    total: OutDense,
    missing: OutRow,
    held: OutRow,
) -> None:
    """Write S D + C (r, r) with the spring, b (r,), and what the spring holds (r,).

    A tangent that slides pushes by p_t = (mu p_n + grip) direction, and its direction turns with
    the slip. What it misses was taken at the projected normal impulse; the piece is linear in p_n.

    Args:
        system: of the rows.
        pieces, sliding: see `pieces_at`.
        impulse: (r,) of the point of the pieces.
        total, missing, held: to write.
    """
    delassus, tangents, size = system.delassus, system.tangents, len(pieces)
    contacts = len(system.frictions)
    first = size - contacts * tangents
    for i in range(size):
        share, missing[i] = pieces[i, 0], pieces[i, 2]
        for j in range(size):
            total[i, j] = share * delassus[i, j]
        held[i] = system.spring[i] * share
        total[i, i] += pieces[i, 1] + held[i]
    for contact in range(contacts if tangents else 0):
        turning, normal = sliding[contact, 2], first - contacts + contact
        if turning < 0.0:
            continue
        start = first + contact * tangents
        for a in range(tangents):
            row, way = start + a, sliding[contact, a]
            along = system.frictions[contact] * way
            total[row, normal] -= along
            missing[row] = along * impulse[normal] - impulse[row] + system.grips[contact] * way
            for b in range(tangents if tangents == 2 else 0):
                turn = turning * ((1.0 if a == b else 0.0) - way * sliding[contact, b])
                add_times(system.slope[row] * turn, delassus[start + b], total[row])
                total[row, start + b] -= turn
                if a == b:
                    held[row] = system.spring[row] * system.slope[row] * turn
                    total[row, row] += held[row]


@compiled(inside=True)
def solve_pieces(
    system: RowSystem, pieces: Dense, sliding: Dense, impulse: Row, solved: OutRow
) -> bool:
    """Write the row impulses (r,) that solve the pieces; False where they contradict each other.

    Rows that depend on each other (more stuck gears and sticking contacts than the robot has
    freedoms) leave their split open; what is left open stays near `impulse` (r,), the point of the
    pieces: a proximal term, whose effect on the rest a second solve with the same factors removes.
    """
    size = len(impulse)
    total, pivots = np.empty((size, size)), np.empty(size, dtype=np.int64)
    change, held = np.empty(size), np.empty(size)
    put_together(system, pieces, sliding, impulse, total, change, held)
    if not factor(total, pivots):
        return False
    solve_factored(total, pivots, change)
    for i in range(size):
        solved[i] = impulse[i] + change[i]
        held[i] *= change[i]
    solve_factored(total, pivots, held)
    add_times(1.0, held, solved)
    return True
