"""A step seen from its rows: their laws, and the linear pieces of these.

The rows G v of a step, speeds u = free + (G H^-1 G') impulse, are elements (gears, dry friction),
then limits and contact normals, then the contacts' tangents. A piece of a row's law is
on_speed du + on_impulse dp = missing, with the row's natural residual beside it: the line of slope
`slope` through (speed, impulse) meets a monotone law in one point, and the residual is how far away
that is, as a speed; zero exactly at a solution. For contacts it is Alart and Curnier's map, the
normal projected onto the half line, the tangents onto the disc of radius mu p_n.

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

from wbc.compiled import Dense, OutDense, OutRow, Row, compiled, inner, local
from wbc.mechanics.linear import dot, halfway, products


class RowSystem(NamedTuple):
    """What a step is to its rows.

    Attributes:
        half: (n, r) L'^-1 G', whose products are the compliance of the rows.
        delassus: (r, r) G H^-1 G'.
        free: (r,) row speeds without impulses, from the ground's where it moves.
        spring: (r,) compliance with which rows hold on to a split of forces that is left open.
        slope: (r,) [impulse/speed] of the line on which each row meets its law.
        laws: (m, 9) per element up, down, inertia, 1/eta_f, eta_b, friction, damping, stiffness
            and preload of the spring in series.
        targets: (l + k,) lowest speeds of limits and normals.
        frictions: mu (k,) of the contacts.
        grips: (k,) friction impulse that contacts have whatever they press, see `solve_system`.
        tangents: d per contact.
    """

    half: OutDense
    delassus: OutDense
    free: OutRow
    spring: OutRow
    slope: OutRow
    laws: OutDense
    targets: OutRow
    frictions: OutRow
    grips: OutRow
    tangents: int


@inner
def lines(delassus: Dense, laws: Dense, pairs: int, spring: OutRow, slope: OutRow) -> None:
    """Write the springs that hold a split left open, and the slopes on which rows meet their laws.

    Args:
        delassus: (r, r).
        laws: (m, 9); the line of a self-locking element meets its law once.
        pairs: number of rows at the end that are pairs of tangents, which share a slope.
        spring: (r,) to write.
        slope: (r,) to write.
    """
    size, most = len(delassus), 0.0
    for i in range(size):
        most = max(most, delassus[i, i])
    floor = max(1e-9 * most, 1e-21)
    for i in range(size):
        own = max(delassus[i, i], floor)
        spring[i], slope[i] = 1e-9 * own, 1.0 / own
    for i in range(size - pairs, size, 2):
        both = 1.0 / (1.0 / slope[i] + 1.0 / slope[i + 1])
        slope[i] = slope[i + 1] = both
    for i in range(len(laws)):
        if laws[i, 4] < 0.0:
            slope[i] = min(slope[i], 0.5 * laws[i, 2] / -laws[i, 4])


@compiled
def system_of(
    matrix: Dense,
    lower: Dense,
    free: Row,
    laws: OutDense,
    targets: OutRow,
    frictions: OutRow,
    tangents: int,
) -> RowSystem:
    """Return the system of the rows `matrix` G (r, n).

    Args:
        matrix: G.
        lower: L (n, n) with L' L = H_l.
        free: v (n,) without the rows.
        laws, targets, frictions, tangents: see `RowSystem`.
    """
    size, n = matrix.shape
    half, delassus = np.empty((n, size)), np.empty((size, size))
    own, spring, slope = np.empty(size), np.empty(size), np.empty(size)
    for i in range(size):
        own[i] = dot(free, matrix[i])
        for j in range(n):
            half[j, i] = matrix[i, j]
    halfway(lower, half)
    products(half, delassus)
    lines(delassus, laws, len(frictions) * 2 if tangents == 2 else 0, spring, slope)
    grips = np.zeros(len(frictions))
    return RowSystem(half, delassus, own, spring, slope, laws, targets, frictions, grips, tangents)


@compiled(inside=True)
def copied(system: RowSystem) -> RowSystem:
    """Return a system whose numbers can be changed, but for `half`."""
    return RowSystem(
        system.half, system.delassus.copy(), system.free.copy(), system.spring.copy(),
        system.slope.copy(), system.laws.copy(), system.targets.copy(), system.frictions.copy(),
        system.grips.copy(), system.tangents,
    )  # fmt: skip


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
    speed: float = (bring - gain * (point + sign * law[5])) / (law[2] + gain * (law[6] + slope))
    return speed


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
def element_piece(law: Row, slope: float, impulse: float, speed: float, piece: OutRow) -> None:
    """Write on_speed, on_impulse, missing and residual of the piece of an element's law.

    Args:
        law: (9,) up, down, inertia, 1/eta_f, eta_b, friction, damping, stiffness and preload of
            the spring, see `RowSystem`.
        slope: of the line.
        impulse: T of the point.
        speed: u = W v of the point.
        piece: (4,) to write.
    """
    # The spring in series as hold (w - u) = give T - pull: regular from rigid to powerless.
    hold, give, pull = 1.0, 0.0, 0.0
    if law[7] < np.inf:
        give = 1.0 / (law[7] + slope)
        hold, pull = law[7] * give, law[8] * give
    point = hold * (impulse - slope * speed) + slope * pull
    sign, gain, bring = branch_of(law, point, hold * slope)
    if sign == 0.0:
        missing = pull - hold * speed - give * impulse
        piece[0], piece[1], piece[2], piece[3] = hold, give, missing, missing
        return
    own = law[2] + gain * law[6]
    on_speed, on_impulse = own * hold, gain * hold + own * give
    missing = hold * (bring - gain * (impulse + sign * law[5]))
    missing -= own * (hold * speed + give * impulse - pull)
    piece[0], piece[1], piece[2] = on_speed, on_impulse, missing
    piece[3] = missing / (on_speed + on_impulse * slope)


@inner
def pieces_at(
    system: RowSystem, impulse: Row, speed: Row, pieces: OutDense, sliding: OutDense
) -> float:
    """Write the pieces met by the lines of `slope` through (speed, impulse).

    Args:
        system: of the rows.
        impulse: (r,).
        speed: (r,).
        pieces: (r, 4) to write.
        sliding: (k, 3) to write: direction (2) in which a contact's friction pushes, and
            mu p_n / |p_t - slope u_t| <= 1, how far that may turn; the last is -1 where the contact
            does not slide. The rows of one that does lack the coupling to normal and slip.

    Returns:
        the largest residual, infinite where one is no number.
    """
    laws, targets, frictions = system.laws, system.targets, system.frictions
    tangents, slope = system.tangents, system.slope
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
        contact = i - count + contacts
        sliding[contact, 2], bound = -1.0, system.grips[contact]
        first = m + count + contact * tangents
        if push > 0.0:
            bound += frictions[contact] * push
        wish = local(2)
        wish[:] = 0.0
        for j in range(tangents):
            wish[j] = impulse[first + j] - slope[first + j] * speed[first + j]
        # Far from a solution Newton's points may be huge: hypot does not overflow before they do.
        size = math.hypot(wish[0], wish[1])
        if size < bound:
            for j in range(first, first + tangents):
                pieces[j, 0], pieces[j, 1], pieces[j, 2] = 1.0, 0.0, -speed[j]
                pieces[j, 3] = -speed[j]
            continue
        share = bound / size if size > 0.0 else 1.0
        for j in range(tangents):
            short = share * wish[j] - impulse[first + j]
            pieces[first + j, 0], pieces[first + j, 1], pieces[first + j, 2] = 0.0, 1.0, short
            pieces[first + j, 3] = short / slope[first + j]
        if (push > 0.0 or bound > 0.0) and tangents > 0:
            for j in range(2):
                sliding[contact, j] = wish[j] / size if size > 0.0 else wish[j]
            sliding[contact, 2] = share
    worst = 0.0
    for i in range(len(pieces)):
        if not abs(pieces[i, 3]) <= worst:
            worst = abs(pieces[i, 3]) if pieces[i, 3] == pieces[i, 3] else np.inf
    return worst
