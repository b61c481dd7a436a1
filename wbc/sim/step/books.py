"""Work, losses and what is stored in a part or an impact, and what a user should know of them."""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import Dense, OutDense, Row, ask, compiled, inner, local
from wbc.mechanics.inertia import momentum_of, motion_at
from wbc.mechanics.laws import PLACE, STIFFNESS, passed_by, place_after, stored_at
from wbc.mechanics.linear import copy_to, dot
from wbc.mechanics.memory import row_of, table_of
from wbc.mechanics.rows import TOLERANCE
from wbc.sim.step.contacts import look, put, solid_gap, touch_ground
from wbc.sim.step.part_rows import MISSED, PartRows, motor_speeds, rotor_energy
from wbc.sim.step.tables import BOOK, HERTZ, LENGTH, TOUCH, Gears, Opened

MADE = 5e-5
"""Share of the energy in play that a part may make. The steps of 10 ms in which a leg that falls
and bounces gains 0.06 to 0.65 J have at least 8e-5; what turns freely has its step's own error: at
1 ms a disc that spins on its edge 3e-5, a double pendulum without losses 3e-7."""

ENERGY, COARSE, TAKEN_BACK, UNSETTLED, OVERLAP, SUNK = range(6)
"""Kinds of events, see `StepEvent`; of those that are coarse, in TAKEN_BACK speeds were changed."""

_ROUNDING = 1e-8  # of the energy in play: laws hold to 1e-10 of the speeds
_COARSE = 0.01  # share of the energy in play
_STOPPED = 1e-9  # share of a rotor's speed that is none


@inner
def spring_energy(gears: Gears, which: int, deflection: float) -> float:
    """Return what a compliant gear stores at a deflection [rad], beyond its play [J]."""
    half = 0.5 * gears.play[which]
    bent = deflection - min(max(deflection, -half), half)
    return float(0.5 * gears.stiffness[which] * bent * bent)


@inner
def loose_losses(plant: Opened, rows: PartRows, which: int, lost: float) -> tuple[float, float]:
    """Return the losses [J] in the mesh of a loose gear, and between it and the joint.

    A spring's loss is what it takes and does not store, its damper's is that of the final speed,
    like every law's of a step: what the change of speed within the step makes of it is
    discretisation, and part of the residual. A rotor that hits the rigid flank of its
    play jumps within the step, for which impulse times final speed would be wrong by more than
    O(h): there the loss of mesh and flank together is what the rotor gives and the joint does not
    get, and the mesh has no more than that of it. Without a hit that may be less than nothing, by
    the change of speed within the step: then the mesh's loss is that of the final speed. A gear
    that hangs in its play loses nothing.

    Args:
        plant, rows: see `books_of`.
        which: number of the gear.
        lost: [J] in the mesh at the final speed.
    """
    gears, step = plant.gears, rows.step
    after, mesh = plant.end.motor_speed[which], plant.end.mesh_impulse[which]
    before, rate, end = rows.motor[which], rows.relative[which], rows.end[which]
    damped = 0.5 * mesh * (rate + end)
    if gears.stiffness[which] < np.inf:
        place = plant.now.deflection[which]
        there = place + 0.5 * step * (rate + end)
        _, _, beside = passed_by(rows.flanks[which], end)
        damped += 0.5 * beside * (end - rate) + spring_energy(gears, which, place)
        return lost, damped - spring_energy(gears, which, there)
    if rows.laws[which, 7] == 0.0:
        return lost, 0.0
    rubbed = step * (gears.coulomb[which] * np.sign(after) + gears.viscous[which] * after)
    pushed = step * gears.ratio[which] * plant.end.torque[which] - rubbed
    stored = 0.5 * gears.inertia[which] * (after * after - before * before)
    balance = 0.5 * (pushed - mesh) * (before + after) - stored
    together = balance + damped
    if together > 0.0:
        own = min(max(balance, 0.0), together)
        return own, together - own
    return lost, 0.0


@inner
def book_gears(plant: Opened, rows: PartRows) -> None:
    """Write the motors' work, and what is lost in gears and in friction of joints."""
    books, motor, mesh = plant.end.books, plant.end.motor_speed, plant.end.mesh_impulse
    m, gears, step = len(motor), plant.gears, rows.step
    for i in range(m):
        size = abs(motor[i])
        turned = 0.5 * step * gears.ratio[i] * (rows.motor[i] + motor[i])
        books[BOOK.motor] += plant.end.torque[i] * turned
        books[BOOK.rotor_friction] += step * (gears.coulomb[i] + gears.viscous[i] * size) * size
        gain = rows.laws[i, 3] if motor[i] * mesh[i] > 0.0 else rows.laws[i, 4]
        lost, damped = (gain - 1.0) * mesh[i] * motor[i], 0.0
        if plant.gears.yields[i]:
            lost, damped = loose_losses(plant, rows, i, lost)
        books[BOOK.mesh] += lost
        books[BOOK.gear_damping] += damped
    for i in range(len(rows.laws)):
        size = abs(motor[i] if i < m else rows.speed[i])
        books[BOOK.joint_friction] += (rows.laws[i, 5] + rows.laws[i, 6] * size) * size


@inner
def soft_loss(rows: PartRows, contact: int) -> float:
    """Return what a compliant contact loses: what its spring does not take, at the final speed."""
    row = len(rows.laws) + len(rows.targets) - len(rows.frictions) + contact
    flank = rows.flanks[len(rows.laws) + contact]
    before, after = flank[PLACE], place_after(flank, -rows.speed[row])
    taken = stored_at(flank[STIFFNESS], after) - stored_at(flank[STIFFNESS], before)
    return float(rows.impulse[row] / rows.step * (after - before) - taken)


@inner
def book_barriers(plant: Opened, rows: PartRows) -> None:
    """Write what contacts and stops lose, and what one of them made at most."""
    books, speed = plant.end.books, plant.end.speed
    elements, both = len(rows.laws), len(rows.targets)
    contacts, soft = elements + both - len(rows.frictions), plant.bounds[HERTZ] > 0.0
    for i in range(elements, len(rows.impulse)):
        push, made = rows.impulse[i], rows.impulse[i] * rows.speed[i]
        if i >= elements + both:
            books[BOOK.contact] -= made
            continue
        contact = i - contacts
        if soft and contact >= 0:
            books[BOOK.contact] += soft_loss(rows, contact)
            continue
        for a in range(2 if contact >= 0 else 0):
            along = elements + both + contact * 2 + a
            made += rows.impulse[along] * rows.speed[along]
        books[BOOK.normal] = max(books[BOOK.normal], made)
        mean = 0.5 * (dot(speed, rows.matrix[i]) + dot(plant.end.after, rows.matrix[i]))
        books[BOOK.contact] += max(-push * mean, 0.0)


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
def fastest_turn(plant: Opened, v: Row) -> float:
    """Return how fast a body turns at most [rad/s] at v (nv,), where the memory stands."""
    most, taken = 0.0, plant.heap.used[0]
    motion = table_of(plant.heap, len(plant.tree.joints), 6)
    motion_at(plant.tree.joints, plant.placed.columns, v, motion)
    for i in range(len(motion)):
        most = max(most, dot(motion[i, 3:], motion[i, 3:]))
    plant.heap.used[0] = taken
    return sqrt(most)


@inner
def books_of(plant: Opened, rows: PartRows) -> float:
    """Write work and losses of a part, see `EnergyFlow`; return how fast bodies turn at most.

    That is the sum of start and end [rad/s].

    Args:
        plant: whose memory stands in the middle, with speeds of motors and impulses of the end.
        rows: of the part, as they end.
    """
    books, inertia, speed = plant.end.books, plant.placed.inertia, plant.end.speed
    books[:] = 0.0
    book_gears(plant, rows)
    book_barriers(plant, rows)
    for i in range(len(rows.impulse)):
        # A speed below 10 TOLERANCE is rounding; `result` takes 1e-8 of what moves as such.
        speed_of = abs(rows.speed[i]) + 1e9 * TOLERANCE
        books[BOOK.traffic] += abs(rows.impulse[i]) * speed_of
    for c in range(len(speed)):
        square = speed[c] * speed[c] + plant.end.after[c] * plant.end.after[c]
        books[BOOK.kinetic] += abs(inertia[c, c]) * square
        moved = 0.5 * rows.step * (speed[c] + plant.end.after[c])
        given = plant.forces.external[c]
        books[BOOK.external] += given * moved
        books[BOOK.effects] += (plant.end.force[c] - given) * moved
    return fastest_turn(plant, speed) + fastest_turn(plant, plant.end.after)


@compiled
def survey(plant: Opened, q: Row, v: Row, deflection: Row, speed: Row) -> tuple[float, float, int]:
    """Return what a plant stores [J], the gap of its deepest body [m], and which that is.

    Stored are the kinetic energy of links and rotors, gravity's, and that of springs in gears and
    compliant contacts. The gap is that of the origin of the joint that carries a body, from the
    nearest solid that loops know.

    Args:
        plant: with its numbers.
        q, v: (nq,), (nv,).
        deflection, speed: (m,) of the motor outputs, where gears are loose.
    """
    tree, placed, gears = plant.tree, plant.placed, plant.gears
    joints, poses, solids, m = tree.joints, placed.poses, plant.obstacles.solids, len(gears.rows)
    put(plant, q)
    look(plant)
    about = placed.about
    count, energy, deepest, lowest, taken = len(joints), 0.0, np.inf, -1, plant.heap.used[0]
    motion, motor = table_of(plant.heap, count, 6), row_of(plant.heap, m)
    momentum, normal = local(6), local(3)
    motion_at(joints, placed.columns, v, motion)
    for i in range(count):
        body = placed.bodies[i]
        momentum_of(body, motion[i], momentum)
        energy += 0.5 * dot(momentum, motion[i])
        energy -= dot(tree.gravity, body[1:]) + body[0] * dot(tree.gravity, about)
        gap = np.inf
        for s in range(len(solids)):
            gap = min(gap, solid_gap(solids[s], poses[i, 9:], np.inf, normal))
        if body[0] > 0.0 and gap < deepest:
            deepest, lowest = gap, i
    motor_speeds(gears, v, speed, motor)
    energy += rotor_energy(gears, v, motor)
    for g in range(m):
        if gears.stiffness[g] < np.inf:
            energy += spring_energy(gears, g, deflection[g])
    if plant.bounds[HERTZ] > 0.0:
        touch_ground(plant, plant.now.closed[:0])
        for b in range(len(plant.obstacles.touch)):
            energy += stored_at(plant.bounds[HERTZ], -plant.obstacles.touch[b, 0])
    plant.heap.used[0] = taken
    return energy, deepest, lowest


@inner
def survey_of(plant: Opened, stage: Row) -> tuple[float, float, int]:
    """Return what `survey` finds where a stage starts; the memory holds the stage then."""
    now = plant.now
    copy_to(stage[: len(now.words)], now.words)
    copy_to(stage[len(now.words) :], plant.end.words)
    if plant.forces.asked != 0:
        length, now.numbers[LENGTH] = now.numbers[LENGTH], 0.0
        ask(plant.forces.asked)
        now.numbers[LENGTH] = length
    return survey(plant, now.position, now.velocity, now.deflection, now.motor_speed)


@inner
def tell(told: OutDense, count: int, kind: int, stage: int, size: float, what: float) -> int:
    """Write an event; return how many there are then."""
    told[count, 0], told[count, 1], told[count, 2], told[count, 3] = kind, stage, size, what
    return count + 1


@compiled
def find_events(plant: Opened, stages: Dense, flow: Row, told: OutDense) -> int:
    """Write what there is to tell of a step; return how many events.

    Args:
        plant: whose memory is free.
        stages: (s + 1, w) of the step.
        flow: (13,) work and losses, with those of effects that Python evaluates; empty without.
        told: (3 s + 2, 4) to write: kind, stage, size, and what it is about.
    """
    count, last, most, taken, depth = 0, len(stages) - 1, 0.0, 0.0, 0.0
    had, _, _ = survey_of(plant, stages[0])
    books, end = plant.end.books, plant.end
    for stage in range(last):
        copy_to(stages[stage, len(plant.now.words) :], end.words)
        if stages[stage, LENGTH] > 0.0:
            depth = end.deepest[0]
            if depth > 0.0:
                count = tell(told, count, OVERLAP, stage, depth, end.deepest[1])
        made, cause = books[BOOK.normal], BOOK.normal
        for i in range(BOOK.mesh, BOOK.impact + 1):
            if -books[i] > made:
                made, cause = -books[i], i
        if made > _ROUNDING * (books[BOOK.kinetic] + books[BOOK.traffic]) + 1e-12:
            count = tell(told, count, ENERGY, stage, made, cause)
        if end.work[MISSED] > 0.0:
            count = tell(told, count, UNSETTLED, stage, end.work[MISSED], 0.0)
        most, taken = max(most, books[BOOK.kinetic]), taken + books[BOOK.taken]
    has, gap, lowest = survey_of(plant, stages[last])
    # Contacts may be as deep as a step leaves them.
    hovers = len(plant.placed.bases) > 0 and len(plant.obstacles.contacts) > 0
    if hovers and gap < -max(TOUCH, depth):
        count = tell(told, count, SUNK, last - 1, -gap, lowest)
    all_of = flow if len(flow) else plant.now.flow
    work, lost = np.sum(all_of[: BOOK.bent]), np.sum(all_of[BOOK.mesh :])
    play, gain = most + abs(work) + lost, has - had + all_of[BOOK.bent] + lost - work
    if taken > 0.0 or gain > min(_COARSE * play, MADE * play + lost) + 1e-9:
        kind = TAKEN_BACK if taken > 0.0 else COARSE
        count = tell(told, count, kind, last - 1, max(gain, taken), play)
    return count
