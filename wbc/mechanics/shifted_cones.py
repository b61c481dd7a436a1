"""Rows of a step by convex programs in velocities, where Newton's pieces turn in circles.

With its slip known, Coulomb's law is the optimality of a convex program: the normal speed plus
mu |u_t| and the tangential speed lie in the dual of the friction cone (G. De Saxce and Z. Feng,
*The bipotential method*, 1998). So rounds of convex programs, each with the slip of the one before
(V. Acary, F. Cadoux, C. Lemarechal and J. Malick, *A formulation of the linear discrete Coulomb
friction problem via convex optimization*, 2011), lead to the law; where all rests, the first one
does. Each row has a small compliance about its impulse of the round before (proximal points), so
that more rows than freedoms are no matter. Then the program is n equations in x = L (v - v_free),

    x - W p(free + W' x) = 0,

the slope of a convex function: Newton's steps, each ended where that function no longer falls
along it, always arrive.
"""

from __future__ import annotations

import math

import numpy as np

from wbc.compiled import OutDense, OutRow, Row, compiled, inner, local
from wbc.mechanics.linear import add_all, add_times, copy_to, dot, factor_inertia, solve_inertia
from wbc.mechanics.rows import RowSystem, element_meets
from wbc.mechanics.tangents import stiffened

_COMPLIANCE = 1e-2
"""Of that of each row alone, in the first round: the softer, the fewer steps it takes. 80 steps of
TALOS that stands with dry friction at 30 joints take 15, 20 and 48 linear systems (mean) from 1e-2,
1e-3 and 1e-4 on; from 1e-1 on 18."""
_STEPS, _CUTS = 30, 20
_SETTLED = 1e-12  # of x
_FLAT = 0.1  # share of a slope that may be left along a step


@inner
def onto_cone(
    mu: float, slope: float, push: float, wish: Row, onto: OutRow, rise: OutDense
) -> None:
    """Write the nearest point of a friction cone to normal and tangential impulses.

    Args:
        mu: half the cone's opening is arctan(mu).
        slope: by which what is wished falls with the speed.
        push: normal impulse that is wished.
        wish: (2,) tangential impulses that are wished; the second is zero in a plane.
        onto: (3,) normal and tangents, to write.
        rise: (3, 3) by which they fall with the speeds, to write.
    """
    size = math.hypot(wish[0], wish[1])
    onto[:], rise[:] = 0.0, 0.0
    if size <= mu * push:
        onto[0], onto[1], onto[2] = push, wish[0], wish[1]
        rise[0, 0] = rise[1, 1] = rise[2, 2] = slope
        return
    if mu * size <= -push:
        return
    pressed, within = (push + mu * size) / (1.0 + mu * mu), slope / (1.0 + mu * mu)
    onto[0], rise[0, 0] = pressed, within
    for a in range(2):
        turn = wish[a] / size
        onto[1 + a] = mu * pressed * turn
        rise[0, 1 + a] = rise[1 + a, 0] = mu * within * turn
        for b in range(2):
            both = turn * wish[b] / size
            across = (1.0 if a == b else 0.0) - both
            rise[1 + a, 1 + b] = mu * mu * within * both + slope * mu * pressed / size * across


@inner
def answer(
    system: RowSystem, own: Row, about: Row, shift: Row, speed: Row, impulse: OutRow, rise: OutDense
) -> None:
    """Write the impulses (r,) of rows with a compliance, and how they fall with the speeds.

    Args:
        system: of the rows; no law of it falls.
        own: (r,) compliance, one of each contact.
        about: (r,) impulses at which it is unloaded.
        shift: (k,) speed by which normals are taken to open faster.
        speed: (r,).
        impulse: to write.
        rise: (r, 3) to write: per speed of the row itself or of the contact's normal, and of the
            contact's two tangents; of an element the second is the sign of its branch instead.
    """
    targets, frictions, d = system.targets, system.frictions, system.tangents
    m, count, contacts = len(system.laws), len(targets), len(frictions)
    wish, onto, block = local(2), local(3), local(9).reshape(3, 3)
    rise[:], wish[:] = 0.0, 0.0
    for i in range(m):
        change, fall, sign = element_meets(system.laws[i], own[i], about[i], speed[i])
        impulse[i], rise[i, 0], rise[i, 1] = about[i] + change, fall, sign
    for i in range(m, m + count - contacts):
        push = about[i] + (targets[i - m] - speed[i]) / own[i]
        if push > 0.0:
            impulse[i], rise[i, 0] = push, 1.0 / own[i]
        else:
            impulse[i] = 0.0
    for contact in range(contacts):
        row, first = m + count - contacts + contact, m + count + contact * d
        target = targets[count - contacts + contact] - shift[contact]
        slope = 1.0 / own[row]
        for a in range(d):
            wish[a] = about[first + a] - slope * speed[first + a]
        push = about[row] + slope * (target - speed[row])
        onto_cone(frictions[contact], slope, push, wish, onto, block)
        impulse[row] = onto[0]
        for b in range(1 + d):
            rise[row, b] = block[0, b]
            for a in range(d):
                rise[first + a, b] = block[1 + a, b]
        for a in range(d):
            impulse[first + a] = onto[1 + a]


@compiled(inside=True)
def minimise(
    system: RowSystem,
    own: Row,
    about: Row,
    shift: Row,
    x: OutRow,
    speed: OutRow,
    impulse: OutRow,
) -> int:
    """Write the end of one convex program; return how many linear systems it took.

    Args:
        system, own, about, shift: see `answer`.
        x: L (v - v_free) (n,) to begin at, and to write.
        speed, impulse: (r,) to write.
    """
    (size, n), ways = system.ways.shape, system.ways
    rise, total, lower = np.empty((size, 3)), np.empty((n, n)), np.empty((n, n))
    step, down, turning, trial = np.empty(n), np.empty(n), np.empty(size), np.empty(size)
    there = np.empty((size, 3))
    for i in range(size):
        speed[i] = system.free[i] + dot(x, ways[i])
    answer(system, own, about, shift, speed, impulse, rise)
    for used in range(1, _STEPS + 1):
        for j in range(n):
            step[j] = -x[j]
        add_all(impulse, ways, step)
        stiffened(system, rise, False, down, total)
        if not factor_inertia(total, lower):
            return used
        copy_to(step, down)
        solve_inertia(lower, step)
        falls, square, along = -dot(down, step), dot(step, step), dot(x, step)
        for i in range(size):
            turning[i] = dot(step, ways[i])
        share, low, high, at_low, at_high = 1.0, 0.0, 1.0, falls, 0.0
        for cut in range(_CUTS):
            for i in range(size):
                trial[i] = speed[i] + share * turning[i]
            answer(system, own, about, shift, trial, impulse, there)
            slope = along + share * square - dot(impulse, turning)
            flat = abs(slope) <= -_FLAT * falls or (cut == 0 and slope < 0.0)
            if flat or cut == _CUTS - 1:
                break
            if slope > 0.0:
                high, at_high = share, slope
            else:
                low, at_low = share, slope
            share = low + (high - low) * at_low / (at_low - at_high)
            share = min(max(share, low + 0.05 * (high - low)), high - 0.05 * (high - low))
        largest = furthest = 0.0
        for j in range(n):
            furthest = max(furthest, abs(x[j]))
            largest = max(largest, abs(step[j]))
        add_times(share, step, x)
        copy_to(trial, speed)
        met = share == 1.0  # a whole step among the same pieces is exact
        for i in range(size):
            for b in range(3):
                met = met and there[i, b] == rise[i, b]
        rise, there = there, rise
        if met or largest <= _SETTLED * (1.0 + furthest):
            break
    return used


@inner
def slips(system: RowSystem, speed: Row, shift: OutRow) -> float:
    """Write mu |u_t| (k,) of the contacts; return the largest change."""
    contacts, d, changed = len(system.frictions), system.tangents, 0.0
    for contact in range(contacts):
        first, square = len(speed) - (contacts - contact) * d, 0.0
        for a in range(d):
            square += speed[first + a] * speed[first + a]
        fresh = system.frictions[contact] * math.sqrt(square)
        changed = max(changed, abs(fresh - shift[contact]))
        shift[contact] = fresh
    return changed


@inner
def compliance_of(system: RowSystem, own: OutRow) -> None:
    """Write a compliance (r,) of each row, a share of its own; one for each contact."""
    contacts, d, size = len(system.frictions), system.tangents, len(own)
    for i in range(size):
        own[i] = _COMPLIANCE * system.own[i]
    for contact in range(contacts):
        first, normal = size - (contacts - contact) * d, size - contacts * (1 + d) + contact
        for a in range(d):
            own[normal] = max(own[normal], own[first + a])
        for a in range(d):
            own[first + a] = own[normal]
