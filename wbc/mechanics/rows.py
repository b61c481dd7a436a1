"""A step seen from its rows: their laws, and the linear pieces of these.

The rows G v of a step, speeds u = free + ways x + give impulse with x = ways' impulse, are elements
(gears, dry friction), then limits and contact normals, then the contacts' tangents. The line of
slope `slope` through (speed, impulse) meets a monotone law in one point; how far away that is, as a
speed, is the row's natural residual, zero exactly at a solution. For contacts it is Alart and
Curnier's map, the normal projected onto the half line, the tangents onto the disc of radius mu p_n.
About that point the law is linear: a tangent has the impulse `aim` at the present speeds, and falls
with them by `rise`. Rows that hold have a small compliance about their present impulse, which
chooses a split of forces that is left open, and carries nothing at a solution.

Over a step a dissipative row (a gear, dry friction, or both in one row) with speed w after the step
carries an impulse T (on the links, along the row). With s = sgn(w) and the gear's share
T_g = T + s f + B w of the impulse:

    w > 0:  M w + k T_g = up        k = 1/eta_f where s T_g > 0 (motor drives), eta_b otherwise
    w < 0:  M w + k T_g = down
    w = 0:  T anywhere between the two branches

M is the reflected rotor inertia (plus the step's viscous share), up and down the impulse that the
rotor brings along: motor impulse plus M w_before, less or plus the rotor's Coulomb impulse. For
eta_f eta_b <= 1 the graph T(w) is non-increasing: a step is a convex program. Friction of a joint
alone is the same law with M = up = down = 0 and both efficiencies one.

A spring in series, T = p + s (w - W v), leaves a law of the same kind between T and u = W v. With
s = 0 it is T = p: it is written so that a spring that hardly changes its impulse (a short step, a
flank that is only just reached) is as regular as a stiff one.

Limits and normals push but never pull: 0 <= p_n, u_n >= target, p_n (u_n - target) = 0. A contact's
tangential impulse obeys Coulomb's law: |p_t| <= mu p_n, and where the point slides,
p_t = -mu p_n u_t / |u_t|.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wbc.compiled import Dense, OutDense, OutPlaces, OutRow, Row, inner, local
from wbc.mechanics.linear import dot, halfway
from wbc.mechanics.memory import (
    Heap,
    copied_row,
    copied_table,
    row_of,
    table_of,
    whole_of,
    zeros_of,
)
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
        targets: (l + k,) lowest speeds of limits and normals.
        frictions: mu (k,) of the contacts.
        tangents: d per contact.
        tolerance: largest distance of a row from its law in a solution, as a speed.
        heap: where arrays come from.
    """

    ways: OutDense
    own: OutRow
    free: OutRow
    give: OutRow
    slope: OutRow
    laws: OutDense
    targets: OutRow
    frictions: OutRow
    tangents: int
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
    targets: OutRow,
    frictions: OutRow,
    tangents: int,
) -> RowSystem:
    """Return the system of the rows `matrix` G (r, n).

    No row's own compliance is nothing, and both tangents of a contact share a slope. The line of a
    self-locking element meets its law once.

    Args:
        heap: where arrays come from.
        matrix: G.
        lower: L (n, n) with L' L = H_l.
        free: v (n,) without the rows.
        laws, targets, frictions, tangents: see `RowSystem`.
    """
    size, ways, most, fastest = len(matrix), copied_table(heap, matrix), 0.0, 0.0
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
    for i in range(size - 2 * len(frictions) if tangents == 2 else size, size, 2):
        own[i] = own[i + 1] = own[i] + own[i + 1]
    for i in range(size):
        slope[i] = 1.0 / own[i]
        if i < len(laws) and laws[i, 4] < 0.0:
            slope[i] = min(slope[i], 0.5 * laws[i, 2] / -laws[i, 4])
    give, tolerance = zeros_of(heap, size), TOLERANCE * (1.0 + fastest)
    system = RowSystem(
        ways, own, speed, give, slope, laws, targets, frictions, tangents, tolerance, heap
    )
    found: RowSystem = kept(whole_of(heap, WORDS), system)
    return found


@inner
def copied(system: RowSystem, tolerance: float) -> RowSystem:
    """Return a system of another tolerance; its numbers can be changed, but for `ways`, `own`."""
    heap = system.heap
    other = RowSystem(
        system.ways, system.own, copied_row(heap, system.free), copied_row(heap, system.give),
        copied_row(heap, system.slope), copied_table(heap, system.laws),
        copied_row(heap, system.targets), copied_row(heap, system.frictions),
        system.tangents, tolerance, heap,
    )  # fmt: skip
    found: RowSystem = kept(whole_of(heap, WORDS), other)
    return found


@inner
def branch_of(law: Row, point: float, slope: float) -> tuple[float, float, float]:
    """Return sign, gain and bring of the branch on which a law meets the line T - slope w = point.

    The sign is +1 turning forward, -1 backward, 0 stuck; the gain is k, the mesh input per output;
    what is brought is `up` or `down`. The line meets the law of a self-locking row once if its
    slope is below M/|eta_b|.

    Args:
        law: (9,) of an element.
        point: [N m s].
        slope: >= 0 [kg m^2].
    """
    up, down, inertia, inverse, backward = law[0], law[1], law[2], law[3], law[4]
    load, resisting = point + law[5], law[6] + slope
    if up > max(load * inverse, load * backward):
        driving = inertia * load + resisting * up > 0.0
        return 1.0, inverse if driving else backward, up
    load = point - law[5]
    if down < min(load * inverse, load * backward):
        driving = -inertia * load - resisting * down > 0.0
        return -1.0, inverse if driving else backward, down
    return 0.0, 0.0, 0.0


@inner
def meeting_speed(law: Row, point: float, slope: float) -> float:
    """Return w at which a law (9,) meets the line T - slope w = point."""
    sign, gain, bring = branch_of(law, point, slope)
    if sign == 0.0:
        return 0.0
    return float((bring - gain * (point + sign * law[5])) / (law[2] + gain * (law[6] + slope)))


@inner
def own_speed(law: Row, slope: float, impulse: float, speed: float) -> float:
    """Return w of an element (9,) that carries an impulse T at u = W v.

    Where there is a spring it follows from the law, not from the spring, whose impulse may hardly
    depend on it.

    Args:
        law: (9,).
        slope: of the line on which the row meets its law.
        impulse: T.
        speed: u.
    """
    if law[7] == np.inf:
        return speed
    give = 1.0 / (law[7] + slope)
    point = give * (law[7] * (impulse - slope * speed) + slope * law[8])
    return meeting_speed(law, point, law[7] * give * slope)


@inner
def element_meets(law: Row, own: float, about: float, speed: float) -> tuple[float, float]:
    """Return where an element's law meets a row that gives way.

    Args:
        law: (9,) of the element.
        own: compliance of the row.
        about: impulse at which it is unloaded.
        speed: u = W v there.

    Returns:
        the change of the impulse, and by how much it falls per speed.
    """
    slope, pull = 1.0 / own, 0.0
    if law[7] < np.inf:
        yields = 1.0 + law[7] * own
        slope, pull = law[7] / yields, (law[8] - about) / yields
    sign, gain, bring = branch_of(law, about + pull - slope * speed, slope)
    if sign == 0.0:
        return pull - slope * speed, slope
    kept = law[2] + gain * law[6]
    share = slope / (kept + gain * slope)
    missing = bring - gain * (about + pull + sign * law[5]) - kept * speed
    return pull + share * missing, share * kept


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
    found: Room = kept(whole_of(heap, WORDS), room)
    return found


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
    d, contacts, slope = system.tangents, len(system.frictions), system.slope
    aim, rise, off, speed = room.aim, room.rise, room.off, room.speed
    first, mu = len(aim) - (contacts - contact) * d, system.frictions[contact]
    row, bound = len(aim) - contacts * (1 + d) + contact, mu * max(push, 0.0)
    wish, along = local(2), 0.0
    wish[:] = 0.0
    for a in range(first, first + d):
        wish[a - first] = impulse[a] - slope[a] * speed[a]
    # Far from a solution Newton's points may be huge: hypot does not overflow before they do.
    size = math.hypot(wish[0], wish[1])
    if size < bound:
        for a in range(d):
            i = first + a
            rise[i, 1 + a] = 1.0 / (hold * system.own[i] + system.give[i])
            aim[i], off[i] = impulse[i] - rise[i, 1 + a] * speed[i], -speed[i]
        return False
    share = bound / size if size > 0.0 else 1.0
    for a in range(d):
        aim[first + a] = share * wish[a]
        off[first + a] = (aim[first + a] - impulse[first + a]) / slope[first + a]
    if bound == 0.0 or size == 0.0:
        return False
    for a in range(d):
        wish[a] /= size
        along += wish[a] * impulse[first + a]
    more = mu * aim[row] - along
    for a in range(d):
        i = first + a
        give = hold * system.own[i] + system.give[i]
        loose = 1.0 / (1.0 - share + share * slope[i] * give)
        aim[i] = impulse[i] + more * wish[a] - loose * (impulse[i] - along * wish[a])
        rise[i, 0] = mu * wish[a] * rise[row, 0]
        for b in range(d if d == 2 else 0):
            turn = (1.0 if a == b else 0.0) - wish[a] * wish[b]
            rise[i, 1 + b] = slope[i] * share * loose * turn
    return bool(mu * rise[row, 0] > 0.0)


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
    speed = room.speed
    rise[:] = 0.0
    for i in range(m):
        own = 1.0 / system.slope[i]
        change, fall = element_meets(system.laws[i], own, impulse[i], speed[i])
        off[i] = own * change
        kept = 1.0 - fall * (own - hold * system.own[i] - system.give[i])
        aim[i], rise[i, 0] = impulse[i] + change / kept, fall / kept
    for i in range(m, m + count):
        short = targets[i - m] - speed[i]
        push = impulse[i] + system.slope[i] * short
        if push > 0.0:
            off[i], rise[i, 0] = short, 1.0 / (hold * system.own[i] + system.give[i])
            aim[i] = impulse[i] + rise[i, 0] * short
        else:
            off[i], aim[i] = -impulse[i] / system.slope[i], 0.0
        contact = i - m - count + contacts
        if contact >= 0:
            falls = friction_tangent(system, hold, contact, push, impulse, room)
            one_sided = one_sided or falls
    worst = 0.0
    for i in range(len(off)):
        if not abs(off[i]) <= worst:
            worst = abs(off[i]) if off[i] == off[i] else np.inf
    return worst, one_sided
