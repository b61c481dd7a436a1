"""An impact: barriers that are reached stop the robot at once, and give back what they do.

Newton's restitution with friction may ask for more energy than there was (Kane's paradox), or for
what the joints cannot do. Without restitution an impact only loses energy; towards the share of the
restitution that just does so, a fixed number of tries.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Flags, Row, ask, inner
from wbc.mechanics.linear import copy_to, dot
from wbc.mechanics.memory import copied_row
from wbc.mechanics.newton import UNSOLVED
from wbc.sim.step.contacts import gaps_of
from wbc.sim.step.motion import weigh
from wbc.sim.step.part_rows import (
    NO_INERTIA,
    WAY,
    PartRows,
    motor_speeds,
    rotor_brings,
    rotor_energy,
    rows_where,
    solve_part,
)
from wbc.sim.step.tables import BOOK, RESTITUTION, TOUCH, Gears, Opened

APART, RESTING, HIT = range(3)
"""Nothing is reached; reached without speed; an impact."""
_SLOW = 1e-9
_STOPPED = 1e-9
_ROUNDING = 1e-9
_TRIES = 5
"""Shares of the restitution tried between none and all; the loss is quadratic in the share while
rows keep to their pieces, so that false position meets it soon."""
_SHARE_OF_WORK = 0.1
"""Of what a step may do, for an impact with restitution: there is another without."""


@inner
def kinetic_of(plant: Opened, v: Row, motor: Row) -> float:
    """Return the kinetic energy at v (nv,) with motor outputs at (m,), where the memory stands."""
    energy = rotor_energy(plant.gears, v, motor)
    for i in range(len(v)):
        energy += 0.5 * v[i] * dot(v, plant.placed.inertia[i])
    return energy


@inner
def mesh_loss(gears: Gears, v: Row, after: Row, motor: Row, following: Row, mesh: Row) -> float:
    """Return the energy lost in the meshes of the rigid gears along the straight path [J].

    It is what the rotors and their coupling to the housings give and the links do not get: with
    the mesh impulse T and the coupling's C on the rotor, (M (w - w') + C - T) (w + w')/2 per gear.
    A gear that reverses has a bent path: its rotor gives all it has, of which (1 - eta_f) is lost,
    then takes new energy E from the mesh, which costs (1/eta_b - 1) E. A self-locking gear that
    stops carries any more impulse at rest, where it does no work: driving it has lost
    (1 - eta_f) of the rotor's energy, driven it all of that and 1/|eta_b| times as much again.

    Args:
        gears: of the plant.
        v, after: (nv,) before and after.
        motor, following: (m,) speeds of the motor outputs before and after.
        mesh: impulses T of the gears, which come first.
    """
    total = 0.0
    for g in range(len(motor)):
        if gears.yields[g]:
            continue
        before, then, half = motor[g], following[g], 0.5 * gears.inertia[g]
        given, taken = half * before**2, half * then**2
        net, backward, forward = -mesh[g], gears.backward[g], 1.0 / gears.inverse[g]
        for j in range(len(v) if len(gears.coupling) else 0):
            net -= gears.coupling[g, j] * (after[j] - v[j])
        if backward < 0.0 and abs(then) <= _STOPPED * abs(before):
            total += given * (1.0 - forward if net * before < 0.0 else 1.0 - 1.0 / backward)
        elif before * then < 0.0:
            again = 1.0 / backward if backward > 0.0 else 1.0
            total += (1.0 - forward) * given + (again - 1.0) * taken
        else:
            total += given - taken + 0.5 * net * (before + then)
    return total


@inner
def impact_rows(plant: Opened, together: Flags) -> PartRows:
    """Return the rows of an impact of some barriers (2 j + c,), where the memory stands.

    Without motor impulse each gear presents eta_f N^2 I_r while its speed falls towards zero and
    N^2 I_r / eta_b while it grows, from its speed before on, see `rotor_brings`. Coulomb levels
    and springs are forces and give no impulse: loose gears pass none. Self-locking gears go on from
    what they carried before. The targets are still to be written.
    """
    gears, rows = plant.gears, rows_where(plant, together, 0, 0.0)
    for i in range(len(rows.laws)):
        law = rows.laws[i]
        if gears.yields[i]:
            law[2] = law[3] = law[4] = 1.0
            continue
        law[2], law[3], law[4] = gears.inertia[i], gears.inverse[i], gears.backward[i]
        law[7] = np.inf
        rotor_brings(gears, i, law[2] * rows.motor[i], law)
        if law[4] < 0.0:
            rows.start[i] = plant.now.impulse[i]
    return rows


@inner
def reaches(plant: Opened, goes_on: bool) -> bool:
    """Write the barriers that are reached, and those that take part; return whether there are any.

    Arguments as of `impact_at`. The poses and touches then stand where the robot is.
    """
    end, before, found = plant.end, plant.now.closed, False
    gaps_of(plant, plant.now.position, end.gap)
    for i in range(len(before)):
        near = end.gap[i] <= TOUCH and i < plant.obstacles.rigid
        end.fresh[i] = near and not before[i]
        end.closed[i] = before[i] or end.fresh[i] or (goes_on and plant.now.kept[i])
        found = found or (end.closed[i] and not before[i])
    return found


@inner
def impact_targets(plant: Opened, share: float, left: float, rows: PartRows) -> bool:
    """Write at which speeds the barriers are to part; return whether one of them is coming.

    What is kept, or was reached in the step before, does not spring back. Arguments as of
    `impact_at`; found[BOOK.share] is that share where any springs back.
    """
    end, now, v, coming = plant.end, plant.now, plant.now.velocity, False
    before = now.closed
    for row in range(len(rows.held)):
        i = rows.held[row]
        approach = dot(v, rows.matrix[len(rows.laws) + row])
        ahead = not before[i] and not end.fresh[i]
        least = -2.0 * end.gap[i] / left if ahead else 0.0
        back = 0.0 if ahead or now.struck[i] or now.kept[i] else plant.bounds[RESTITUTION]
        opening = -share * back * min(approach, 0.0)
        if back * min(approach, 0.0) < 0.0:
            end.books[BOOK.share] = share
        coming = coming or (not before[i] and approach < least - _SLOW)
        rows.targets[row] = least + opening
    return coming


@inner
def impact_at(plant: Opened, share: float, left: float, goes_on: bool) -> int:
    """Write the impact on barriers that have just been reached into `plant.end`, see `settle`.

    Args:
        plant: what moves, with its state.
        share: of the restitution.
        left, goes_on: see `settle`.

    Returns:
        APART, RESTING or HIT; of these only HIT writes speeds and impulses. It failed where
        work[WAY] is UNSOLVED or more; found[BOOK.share] is zero where nothing springs back.
    """
    end, gravity, before, v = plant.end, plant.tree.gravity, plant.now.closed, plant.now.velocity
    gears, found = plant.gears, end.books
    found[:] = 0.0
    if not reaches(plant, goes_on):
        return APART
    weigh(plant)
    rows = impact_rows(plant, end.closed)
    if not rows.lower[0, 0] > 0.0:
        end.work[WAY] = NO_INERTIA
        return HIT
    if not impact_targets(plant, share, left, rows):
        for i in range(len(before)):
            end.closed[i] = before[i] or end.fresh[i]
        return RESTING
    found[BOOK.kinetic] = kinetic_of(plant, v, rows.motor)
    work = 1.0 if found[BOOK.share] == 0.0 else _SHARE_OF_WORK
    way = solve_part(plant, rows, v, work)
    copy_to(rows.impulse[: len(gears.rows)], end.mesh_impulse)
    if way >= UNSOLVED:
        return HIT
    following = copied_row(plant.heap, rows.motor)
    motor_speeds(gears, end.after, rows.motor, following)
    found[BOOK.impact_mesh] = mesh_loss(gears, v, end.after, rows.motor, following, rows.impulse)
    found[BOOK.impact] = (
        found[BOOK.kinetic] - kinetic_of(plant, end.after, following) - found[BOOK.impact_mesh]
    )
    # What parts so slowly that gravity brings it back within the step stays closed.
    slow = 0.5 * left * np.sqrt(dot(gravity, gravity))
    for row in range(len(rows.held)):
        i, speed = rows.held[row], rows.speed[len(rows.laws) + row]
        parts = speed > max(TOUCH, slow)
        end.closed[i] = (before[i] or end.fresh[i]) and not parts
    return HIT


@inner
def lost_by(plant: Opened) -> float:
    """Return what an impact loses in its contacts [J]; no number where it has no solution."""
    return float(plant.end.books[BOOK.impact] if plant.end.work[WAY] < UNSOLVED else np.nan)


@inner
def settle(plant: Opened, left: float, goes_on: bool) -> int:
    """Take the impact on barriers that have just been reached, into `plant.end`.

    A barrier counts as reached where its gap is closed and the state does not know it to be. After
    the impact those stay closed that part so slowly that gravity would bring them back within what
    is left of the step: their rows let them open, and spare them an impact and a part of their own.

    A kept barrier is a row of the rest of the step, and the row acts from the middle on. An impact
    elsewhere must not drive the robot through it before: where it closes faster than 2 gap/left it
    takes part in the impact, and then closes at that speed.

    The impact has the largest share of the restitution at which it makes no energy, by a few tries.

    Args:
        plant: what moves, with its state.
        left: of the step [s].
        goes_on: whether there is a rest of the step, of which the kept barriers are rows.

    Returns:
        APART, RESTING or HIT, see `impact_at`.
    """
    found, high, low = plant.end.books, 1.0, 0.0
    if plant.forces.asked != 0:
        ask(plant.forces.asked)
    kind = impact_at(plant, 1.0, left, goes_on)
    lost_high = lost_by(plant)
    if kind != HIT or found[BOOK.share] == 0.0 or lost_high >= -_ROUNDING * found[BOOK.kinetic]:
        return kind
    impact_at(plant, 0.0, left, goes_on)
    lost_low = lost_by(plant)
    for _ in range(_TRIES if lost_low == lost_low else 0):
        share = 0.5 * (low + high)
        if lost_high < 0.0:
            share = low + (high - low) * lost_low / (lost_low - lost_high)
            share = min(max(share, low + 0.1 * (high - low)), high - 0.1 * (high - low))
        impact_at(plant, share, left, goes_on)
        lost = lost_by(plant)
        if lost >= -_ROUNDING * found[BOOK.kinetic]:
            low, lost_low = share, lost
        else:
            high, lost_high = share, lost
    impact_at(plant, low, left, goes_on)
    return kind
