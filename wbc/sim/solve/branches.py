"""The linear piece of every row's law that a point lies on, and the system of those pieces.

A piece is on_speed dw + on_impulse dp = missing, with the row's natural residual beside it: the
line of slope `slope` through (speed, impulse) meets a monotone law in one point, and the residual
is how far away that is, as a speed; zero exactly at a solution. For contacts it is Alart and
Curnier's map, the normal projected onto the half line, the tangents onto the disc of radius mu p_n.
"""

from __future__ import annotations

import math

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import Count, Dense, Flag, Nothing, Number, OutDense, OutRow, Row, compiled, local
from wbc.sim.solve.linear import factor, solve_factored


@compiled(Nothing, Row, Number, Number, Number, OutRow, counted=False)
def element_piece(
    law: FloatArray, slope: float, impulse: float, speed: float, piece: FloatArray
) -> None:
    """Write on_speed, on_impulse, missing and residual of the piece of an element's law.

    Args:
        law: (9,) up, down, inertia, 1/eta_f, eta_b, friction, damping, stiffness and preload of
            its `Elements`.
        slope: of the line.
        impulse: T of the point.
        speed: u = W v of the point.
        piece: (4,) to write.
    """
    up, down, inertia, inverse, backward, friction = law[0], law[1], law[2], law[3], law[4], law[5]
    # The spring in series as hold (w - u) = give T - pull: regular from rigid to powerless.
    hold, give, pull = 1.0, 0.0, 0.0
    if law[7] < np.inf:
        give = 1.0 / (law[7] + slope)
        hold, pull = law[7] * give, law[8] * give
    resisting = law[6] + hold * slope
    point = hold * (impulse - slope * speed) + slope * pull
    load = point + friction
    if up > max(load * inverse, load * backward):
        driving = inertia * load + resisting * up > 0.0
        sign, bring = 1.0, up
    else:
        load = point - friction
        if not down < min(load * inverse, load * backward):
            missing = pull - hold * speed - give * impulse
            piece[0], piece[1], piece[2], piece[3] = hold, give, missing, missing
            return
        driving = -inertia * load - resisting * down > 0.0
        sign, bring = -1.0, down
    gain = inverse if driving else backward
    own = inertia + gain * law[6]
    on_speed, on_impulse = own * hold, gain * hold + own * give
    missing = hold * (bring - gain * (impulse + sign * friction))
    missing -= own * (hold * speed + give * impulse - pull)
    piece[0], piece[1], piece[2] = on_speed, on_impulse, missing
    piece[3] = missing / (on_speed + on_impulse * slope)


@compiled(Number, Dense, Row, Row, Count, Row, Row, Row, OutDense, OutDense, counted=False)
def pieces_at(
    laws: FloatArray,
    targets: FloatArray,
    frictions: FloatArray,
    tangents: int,
    slope: FloatArray,
    impulse: FloatArray,
    speed: FloatArray,
    pieces: FloatArray,
    sliding: FloatArray,
) -> float:
    """Write the pieces met by the lines of `slope` through (speed, impulse).

    Args:
        laws: (m, 9) of the elements.
        targets: (l + k,) lowest normal speeds.
        frictions: (k,) mu.
        tangents: d per contact.
        slope: (r,).
        impulse: (r,).
        speed: (r,).
        pieces: (r, 4) to write.
        sliding: (k, 3) to write: direction (2) in which a contact's friction pushes, and
            mu p_n / |p_t - slope u_t| <= 1, how far that may turn; the last is -1 where the contact
            does not slide. The rows of one that does lack the coupling to normal and slip.

    Returns:
        the largest residual, infinite where one is no number.
    """
    m, count, contacts = len(laws), len(targets), len(frictions)
    for i in range(m):
        element_piece(laws[i], slope[i], impulse[i], speed[i], pieces[i])
    for i in range(count):
        row, piece = m + i, pieces[m + i]
        short = targets[i] - speed[row]
        push = impulse[row] + slope[row] * short
        if push > 0.0:
            piece[0], piece[1], piece[2], piece[3] = 1.0, 0.0, short, short
        else:
            piece[0], piece[1], piece[2] = 0.0, 1.0, -impulse[row]
            piece[3] = -impulse[row] / slope[row]
        if i < count - contacts:
            continue
        contact, bound = i - count + contacts, 0.0
        sliding[contact, 2] = -1.0
        first = m + count + contact * tangents
        if push > 0.0:
            bound = frictions[contact] * push
        wish = local(2)
        wish[:] = 0.0
        for j in range(tangents):
            wish[j] = impulse[first + j] - slope[first + j] * speed[first + j]
        # Far from a solution Newton's points may be huge: hypot does not overflow before they do.
        size = math.hypot(wish[0], wish[1])
        if push > 0.0 and size < bound:
            for j in range(first, first + tangents):
                pieces[j, 0], pieces[j, 1], pieces[j, 2] = 1.0, 0.0, -speed[j]
                pieces[j, 3] = -speed[j]
            continue
        share = bound / size if size > 0.0 else 1.0
        for j in range(tangents):
            short = share * wish[j] - impulse[first + j]
            pieces[first + j, 0], pieces[first + j, 1], pieces[first + j, 2] = 0.0, 1.0, short
            pieces[first + j, 3] = short / slope[first + j]
        if push > 0.0 and tangents > 0:
            for j in range(2):
                sliding[contact, j] = wish[j] / size if size > 0.0 else wish[j]
            sliding[contact, 2] = share
    worst = 0.0
    for i in range(len(pieces)):
        if not abs(pieces[i, 3]) <= worst:
            worst = abs(pieces[i, 3]) if pieces[i, 3] == pieces[i, 3] else np.inf
    return worst


@compiled(Flag, Dense, Row, Row, Row, Count, Dense, Dense, Row, OutRow)
def solve_pieces(
    delassus: FloatArray,
    spring: FloatArray,
    slope: FloatArray,
    frictions: FloatArray,
    tangents: int,
    pieces: FloatArray,
    sliding: FloatArray,
    impulse: FloatArray,
    solved: FloatArray,
) -> bool:
    """Write the row impulses (r,) that solve the pieces; False where they contradict each other.

    Rows that depend on each other (more stuck gears and sticking contacts than the robot has
    freedoms) leave their split open; what is left open stays near `impulse` (r,), the point of the
    pieces, by a proximal term whose effect on the rest a second solve with the same factors
    removes.
    """
    size, contacts = len(impulse), len(frictions)
    total, pivots = np.empty((size, size)), np.empty(size, dtype=np.int64)
    change, correction = np.empty(size), np.empty(size)
    for i in range(size):
        for j in range(size):
            total[i, j] = pieces[i, 0] * delassus[i, j]
        total[i, i] += pieces[i, 1] + spring[i] * pieces[i, 0]
        change[i] = pieces[i, 2]
    for contact in range(contacts):
        turning = sliding[contact, 2]
        if turning < 0.0:
            continue
        # p_t = mu p_n direction, and how the direction turns with the slip. What the rows miss was
        # taken at the bound mu times the projected normal impulse; the piece is linear in p_n.
        first = size - (contacts - contact) * tangents
        normal = size - contacts * (tangents + 1) + contact
        for a in range(tangents):
            row, along = first + a, frictions[contact] * sliding[contact, a]
            total[row, normal] -= along
            change[row] = along * impulse[normal] - impulse[row]
            for b in range(tangents if tangents == 2 else 0):
                turn = -sliding[contact, a] * sliding[contact, b] + (1.0 if a == b else 0.0)
                turn *= turning
                total[row, first + b] -= turn
                for j in range(size):
                    total[row, j] += slope[first] * turn * delassus[first + b, j]
    if not factor(total, pivots):
        return False
    solve_factored(total, pivots, change)
    for i in range(size):
        correction[i] = spring[i] * pieces[i, 0] * change[i]
    solve_factored(total, pivots, correction)
    for i in range(size):
        solved[i] = impulse[i] + change[i] + correction[i]
    return True
