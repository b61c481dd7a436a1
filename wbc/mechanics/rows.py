"""A step seen from its rows: their laws, and the linear pieces of these.

The rows G v of a step, speeds u = free + ways x + give impulse with x = ways' impulse, are elements
(gears, dry friction), then limits and contact normals, then two tangents of each contact. The line
of slope `slope` through (speed, impulse) meets a monotone law in one point; how far away that is,
as a speed, is the row's natural residual, zero exactly at a solution. For contacts it is Alart and
Curnier's map, the normal projected onto the half line, the tangents onto the disc of radius mu p_n.
About that point the law is linear: a tangent has the impulse `aim` at the present speeds, and falls
with them by `rise`. Rows that hold have a small compliance about their present impulse, which
chooses a split of forces that is left open, and carries nothing at a solution.

Limits and normals push but never pull: 0 <= p_n, u_n >= target, p_n (u_n - target) = 0. A contact's
tangential impulse obeys Coulomb's law: |p_t| <= mu p_n, and where the point slides,
p_t = -mu p_n u_t / |u_t|.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wbc.compiled import Dense, OutDense, OutPlaces, OutRow, Row, inner, local
from wbc.mechanics.laws import STIFFNESS, element_meets, flank_meets
from wbc.mechanics.linear import dot, halfway
from wbc.mechanics.memory import Heap, row_copy, row_of, table_copy, table_of, whole_of, zeros_of
from wbc.structures import WORDS, kept, structured


@structured
class RowSystem(NamedTuple):
    """What a step is to its rows.

    Attributes:
        ways: (r, n) G L^-1, whose products are the compliance of the rows.
        own: (r,) compliance of each row alone, of both tangents of a contact together.
        free: (r,) row speeds without impulses, from the ground's where it moves.
        give: (r,) compliance of each row beside that of the links.
        slope: (r,) [impulse/speed] of the line on which each row meets its law.
        laws: (m, 9) per element up, down, inertia, 1/eta_f, eta_b, friction, damping, stiffness
            and preload of the spring in series.
        flanks: (m + k, 9) of the elements and of the contacts, see `flank_meets`; of infinite
            stiffness where nothing gives way, empty where nothing does anywhere.
        targets: (l + k,) lowest speeds of limits and normals.
        frictions: mu (k,) of the contacts.
        tolerance: largest distance of a row from its law in a solution, as a speed.
        heap: where arrays come from.
    """

    ways: OutDense
    own: OutRow
    free: OutRow
    give: OutRow
    slope: OutRow
    laws: OutDense
    flanks: OutDense
    targets: OutRow
    frictions: OutRow
    tolerance: float
    heap: Heap


TOLERANCE = 1e-10
"""Accepted distance of a row from its law, as a share of the largest speed or target plus 1.

A target below zero does not count: a row reaches it only at speeds that count already, and a
barrier that is kept in a short part has one that no speed comes near.
"""


@inner
def system_of(
    heap: Heap,
    matrix: Dense,
    lower: Dense,
    free: Row,
    laws: OutDense,
    flanks: OutDense,
    targets: OutRow,
    frictions: OutRow,
) -> RowSystem:
    """Return the system of the rows `matrix` G (r, n).

    No row's own compliance is nothing, and both tangents of a contact share a slope. The line of a
    self-locking element meets its law once.

    Args:
        heap: where arrays come from.
        matrix: G.
        lower: L (n, n) with L' L = H_l.
        free: v (n,) without the rows.
        laws, flanks, targets, frictions: see `RowSystem`.
    """
    size, ways, most, fastest = len(matrix), table_copy(heap, matrix), 0.0, 0.0
    own, speed, slope = row_of(heap, size), row_of(heap, size), row_of(heap, size)
    for i in range(size):
        speed[i] = dot(free, matrix[i])
        halfway(lower, ways[i])
        own[i] = dot(ways[i], ways[i])
        most, fastest = max(most, own[i]), max(fastest, abs(speed[i]))
    for i in range(len(targets)):
        fastest = max(fastest, targets[i])
    for i in range(size):
        own[i] = max(own[i], 1e-9 * most, 1e-21)
    for i in range(size - 2 * len(frictions), size, 2):
        own[i] = own[i + 1] = own[i] + own[i + 1]
    for i in range(size):
        slope[i] = 1.0 / own[i]
        if i < len(laws) and laws[i, 4] < 0.0:
            slope[i] = min(slope[i], 0.5 * laws[i, 2] / -laws[i, 4])
    give, tolerance = zeros_of(heap, size), TOLERANCE * (1.0 + fastest)
    system = RowSystem(
        ways, own, speed, give, slope, laws, flanks, targets, frictions, tolerance, heap
    )  # fmt: skip
    return kept(whole_of(heap, WORDS), system)


@inner
def copied(system: RowSystem, tolerance: float) -> RowSystem:
    """Return a system of another tolerance; its numbers can be changed, but for `ways`, `own`."""
    heap = system.heap
    other = RowSystem(
        system.ways, system.own, row_copy(heap, system.free), row_copy(heap, system.give),
        row_copy(heap, system.slope), table_copy(heap, system.laws),
        system.flanks, row_copy(heap, system.targets), row_copy(heap, system.frictions),
        tolerance, heap,
    )  # fmt: skip
    return kept(whole_of(heap, WORDS), other)


@structured
class Room(NamedTuple):
    """Memory for tangents.

    Attributes:
        speed: (r,) of their point.
        aim: (r,) impulses of the tangents there.
        off, turning: (r,) residuals there, and how speeds change.
        rise: (r, 3) by which the impulses fall per speed of the row itself, or of the contact's
            normal, and of the contact's two tangents.
        known: (r, 3) rise of those that `lower` is of.
        lower: (n, n) factors of the system's matrix.
        pivots: (n,) of the latter.
        change, line: (n,) of x, and memory.
    """

    speed: OutRow
    aim: OutRow
    off: OutRow
    turning: OutRow
    rise: OutDense
    known: OutDense
    lower: OutDense
    pivots: OutPlaces
    change: OutRow
    line: OutRow


@inner
def room_for(system: RowSystem) -> Room:
    """Return memory for the tangents of a system."""
    heap, (size, n) = system.heap, system.ways.shape
    known = table_of(heap, size, 3)
    known[:] = np.nan
    room = Room(
        row_of(heap, size), row_of(heap, size), row_of(heap, size), row_of(heap, size),
        table_of(heap, size, 3), known, table_of(heap, n, n),
        whole_of(heap, n), row_of(heap, n), row_of(heap, n),
    )  # fmt: skip
    return kept(whole_of(heap, WORDS), room)


@inner
def friction_tangent(
    system: RowSystem, hold: float, contact: int, push: float, impulse: Row, room: Room
) -> bool:
    """Write the tangent of a contact's friction; return whether it falls with the normal speed.

    A point that slides pushes by p_t = mu p_n direction, and its direction turns with the
    slip. The piece is linear in p_n.

    Args:
        system, hold, impulse, room: see `tangents_at`.
        contact: its number.
        push: normal impulse of the point where the line meets the law.
    """
    contacts, slope = len(system.frictions), system.slope
    aim, rise, off, speed = room.aim, room.rise, room.off, room.speed
    first, mu = len(aim) - (contacts - contact) * 2, system.frictions[contact]
    row, bound = len(aim) - contacts * 3 + contact, mu * max(push, 0.0)
    wish, along = local(2), 0.0
    for a in range(first, first + 2):
        wish[a - first] = impulse[a] - slope[a] * speed[a]
    # Far from a solution Newton's points may be huge: hypot does not overflow before they do.
    size = math.hypot(wish[0], wish[1])
    if size < bound:
        for a in range(2):
            i = first + a
            rise[i, 1 + a] = 1.0 / (hold * system.own[i] + system.give[i])
            aim[i], off[i] = impulse[i] - rise[i, 1 + a] * speed[i], -speed[i]
        return False
    share = bound / size if size > 0.0 else 1.0
    for a in range(2):
        aim[first + a] = share * wish[a]
        off[first + a] = (aim[first + a] - impulse[first + a]) / slope[first + a]
    if bound == 0.0 or size == 0.0:
        return False
    for a in range(2):
        wish[a] /= size
        along += wish[a] * impulse[first + a]
    more = mu * aim[row] - along
    for a in range(2):
        i = first + a
        give = hold * system.own[i] + system.give[i]
        loose = 1.0 / (1.0 - share + share * slope[i] * give)
        aim[i] = impulse[i] + more * wish[a] - loose * (impulse[i] - along * wish[a])
        rise[i, 0] = mu * wish[a] * rise[row, 0]
        for b in range(2):
            turn = (1.0 if a == b else 0.0) - wish[a] * wish[b]
            rise[i, 1 + b] = slope[i] * share * loose * turn
    return bool(mu * rise[row, 0] > 0.0)


@inner
def element_tangent(
    system: RowSystem, hold: float, row: int, flank: int, law: OutRow, impulse: Row, room: Room
) -> float:
    """Write the tangent of a row on the law (9,) of an element; return the impulse that it meets.

    Args:
        system, hold, impulse, room: see `tangents_at`.
        row: its number.
        flank: number of its flanks, where there are any.
        law: of the element.
    """
    own, about, speed = 1.0 / system.slope[row], impulse[row], room.speed[row]
    if len(system.flanks) > 0:
        change, fall = flank_meets(law, system.flanks[flank], own, about, speed)
    else:
        change, fall = element_meets(law, own, about, speed)
    room.off[row] = own * change
    kept = 1.0 - fall * (own - hold * system.own[row] - system.give[row])
    room.aim[row], room.rise[row, 0] = about + change / kept, fall / kept
    return float(about + change)


@inner
def tangents_at(system: RowSystem, hold: float, impulse: Row, room: Room) -> tuple[float, bool]:
    """Write the tangents of the laws where the lines of `slope` through (speed, impulse) meet them.

    Args:
        system: of the rows.
        hold: compliance of rows that hold, as a share of their own.
        impulse: (r,).
        room: with the speeds; aim, rise and residuals are written.

    Returns:
        the largest residual, infinite where one is no number, and whether the rise is one-sided:
        where a point slides, its friction falls with the normal's speed, and not the reverse.
    """
    targets, contacts, one_sided = system.targets, len(system.frictions), False
    m, count, aim, rise, off = len(system.laws), len(targets), room.aim, room.rise, room.off
    speed, flanks, locked = room.speed, system.flanks, local(9)
    rise[:], locked[:] = 0.0, 0.0  # the ground stands still, whatever it carries
    locked[0], locked[1] = -np.inf, np.inf
    for i in range(m):
        element_tangent(system, hold, i, i, system.laws[i], impulse, room)
    for i in range(m, m + count):
        short = targets[i - m] - speed[i]
        push = impulse[i] + system.slope[i] * short
        contact = i - m - count + contacts
        if contact >= 0 and len(flanks) > 0 and flanks[m + contact, STIFFNESS] < np.inf:
            push = element_tangent(system, hold, i, m + contact, locked, impulse, room)
        elif push > 0.0:
            off[i], rise[i, 0] = short, 1.0 / (hold * system.own[i] + system.give[i])
            aim[i] = impulse[i] + rise[i, 0] * short
        else:
            off[i], aim[i] = -impulse[i] / system.slope[i], 0.0
        if contact >= 0:
            falls = friction_tangent(system, hold, contact, push, impulse, room)
            one_sided = one_sided or falls
    worst = 0.0
    for i in range(len(off)):
        if not abs(off[i]) <= worst:
            worst = abs(off[i]) if off[i] == off[i] else np.inf
    return worst, one_sided
