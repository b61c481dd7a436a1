"""Work and losses of a part, and whether it made energy."""

from __future__ import annotations

import numpy as np

from wbc.compiled import Row, inner
from wbc.mechanics.newton import TOLERANCE
from wbc.sim.step.part_rows import PartRows, Solved
from wbc.sim.step.solution import stored_at
from wbc.sim.step.tables import (
    BACKWARD,
    COULOMB,
    DEFLECTION,
    HERTZ,
    INERTIA,
    INVERSE,
    PLAY,
    RATIO,
    STIFFNESS,
    VISCOUS,
    Opened,
)

MOTOR, MESH, ROTOR, GEAR, FRICTION, CONTACT = range(6)
NORMAL, TRAFFIC, KINETIC, MISSED, TAKEN = range(6, 11)
"""Work and losses of a part [J]: see `EnergyFlow`; what one contact or stop made; bounds of what
moved; the speed by which a passive end misses the laws; and what was taken from speeds that the
velocity terms had made, see `passive`."""


@inner
def spring_energy(gear: Row, deflection: float) -> float:
    """Return what a compliant gear stores at a deflection [rad], beyond its play [J]."""
    half = 0.5 * gear[PLAY]
    bent = deflection - min(max(deflection, -half), half)
    stored: float = 0.5 * gear[STIFFNESS] * bent * bent
    return stored


@inner
def loose_losses(
    plant: Opened, step: float, rows: PartRows, solved: Solved, which: int, lost: float
) -> tuple[float, float]:
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
        plant, step, rows, solved: see `books_of`.
        which: number of the gear.
        lost: [J] in the mesh at the final speed.
    """
    gear = plant.gears.numbers[which]
    after, mesh = plant.end.motor_speed[which], plant.end.mesh_impulse[which]
    before, rate, end = rows.motor[which], rows.relative[which], solved.end[which]
    damped = 0.5 * mesh * (rate + end)
    if gear[STIFFNESS] < np.inf:
        damped += 0.5 * solved.damped[which] * (end - rate)
        place = plant.gears.motion[which, DEFLECTION]
        there = place + 0.5 * step * (rate + end)
        return lost, damped - (spring_energy(gear, there) - spring_energy(gear, place))
    if rows.laws[which, 7] == 0.0:
        return lost, 0.0
    rubbed = step * (gear[COULOMB] * np.sign(after) + gear[VISCOUS] * after)
    pushed = step * gear[RATIO] * plant.forces.torque[which] - rubbed
    stored = 0.5 * gear[INERTIA] * (after * after - before * before)
    balance = 0.5 * (pushed - mesh) * (before + after) - stored
    together = balance + damped
    if together > 0.0:
        own = min(max(balance, 0.0), together)
        return own, together - own
    return lost, 0.0


@inner
def book_gears(plant: Opened, step: float, rows: PartRows, solved: Solved) -> None:
    """Write the motors' work, and what is lost in gears and in friction of joints."""
    books, motor, mesh = plant.end.books, plant.end.motor_speed, plant.end.mesh_impulse
    m = len(motor)
    for i in range(m):
        gear, size = plant.gears.numbers[i], abs(motor[i])
        turned = 0.5 * step * gear[RATIO] * (rows.motor[i] + motor[i])
        books[MOTOR] += plant.forces.torque[i] * turned
        books[ROTOR] += step * (gear[COULOMB] + gear[VISCOUS] * size) * size
        gain = gear[INVERSE] if motor[i] * mesh[i] > 0.0 else gear[BACKWARD]
        lost, damped = (gain - 1.0) * mesh[i] * motor[i], 0.0
        if plant.gears.at[i, 1] == 1:
            lost, damped = loose_losses(plant, step, rows, solved, i, lost)
        books[MESH] += lost
        books[GEAR] += damped
    for i in range(len(rows.laws)):
        size = abs(motor[i] if i < m else solved.speed[i])
        books[FRICTION] += (rows.laws[i, 5] + rows.laws[i, 6] * size) * size


@inner
def soft_loss(plant: Opened, step: float, rows: PartRows, solved: Solved, contact: int) -> float:
    """Return what a compliant contact loses: what its spring does not take, at the final speed."""
    stiffness, before = plant.bounds[HERTZ], rows.depths[contact, 0]
    row = len(rows.laws) + len(rows.targets) - len(rows.frictions) + contact
    after = rows.depths[contact, 1] - 0.5 * step * solved.speed[row]
    taken = stored_at(stiffness, after) - stored_at(stiffness, before)
    lost: float = solved.impulse[row] / step * (after - before) - taken
    return lost


@inner
def book_barriers(plant: Opened, step: float, rows: PartRows, solved: Solved) -> None:
    """Write what contacts and stops lose, and what one of them made at most."""
    books, speed, d = plant.end.books, plant.end.speed, plant.obstacles.tangents
    elements, both = len(rows.laws), len(rows.targets)
    contacts = elements + both - len(rows.frictions)
    for i in range(elements, len(solved.impulse)):
        push, made = solved.impulse[i], solved.impulse[i] * solved.speed[i]
        if i >= elements + both:
            books[CONTACT] -= made
            continue
        contact = i - contacts
        if len(rows.depths) and contact >= 0:
            books[CONTACT] += soft_loss(plant, step, rows, solved, contact)
            continue
        for a in range(d if contact >= 0 else 0):
            along = elements + both + contact * d + a
            made += solved.impulse[along] * solved.speed[along]
        books[NORMAL] = max(books[NORMAL], made)
        mean = 0.0
        for c in range(len(speed)):
            mean += 0.5 * rows.matrix[i, c] * (speed[c] + solved.after[c])
        books[CONTACT] += max(-push * mean, 0.0)


@inner
def books_of(plant: Opened, step: float, rows: PartRows, solved: Solved) -> None:
    """Write work and losses of a part, MOTOR to TAKEN, see `EnergyFlow`.

    Args:
        plant: whose memory stands in the middle, with speeds of motors and impulses of the end.
        step: h [s].
        rows: of the part.
        solved: how they end.
    """
    books, inertia, speed = plant.end.books, plant.placed.inertia, plant.end.speed
    books[:] = 0.0
    books[MISSED] = solved.missed
    book_gears(plant, step, rows, solved)
    book_barriers(plant, step, rows, solved)
    for i in range(len(solved.impulse)):
        # A speed below 10 TOLERANCE is rounding; `result` takes 1e-8 of what moves as such.
        speed_of = abs(solved.speed[i]) + 1e9 * TOLERANCE
        books[TRAFFIC] += abs(solved.impulse[i]) * speed_of
    for c in range(len(speed)):
        square = speed[c] * speed[c] + solved.after[c] * solved.after[c]
        books[KINETIC] += abs(inertia[c, c]) * square
