"""What a plant stores, and the bound that it sets to a part: no part makes energy.

The velocity terms of a part are those of its start and its middle. Where bodies turn far within a
part they may make energy, and what is too fast turns farther in the next one. So a part that ends
with more energy than it was given is slowed down at its end: the joints first, whose speeds alone
these terms change, with the momentum of free bases kept; where a rigid body would still have too
much, all of it.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import OutRow, Row, compiled
from wbc.mechanics.inertia import bodies_at, momentum_of, motion_at
from wbc.mechanics.kinematics import columns_at, place
from wbc.mechanics.linear import dot
from wbc.sim.step.books import KINETIC, MOTOR, TAKEN, spring_energy
from wbc.sim.step.contacts import solid_gap, touch_ground
from wbc.sim.step.field import AHEAD
from wbc.sim.step.gears import motor_speeds, rotor_energy
from wbc.sim.step.motion import set_momentum
from wbc.sim.step.solution import stored_at
from wbc.sim.step.tables import (
    DEFLECTION,
    HERTZ,
    REACH,
    SPEED,
    STIFFNESS,
    Opened,
    point_of_reference,
)

MADE = 5e-5
"""Share of the energy in play that a part may make. The steps of 10 ms in which a leg that falls
and bounces gains 0.06 to 0.65 J have at least 8e-5; what turns freely has its step's own error: at
1 ms a disc that spins on its edge 3e-5, a double pendulum without losses 3e-7."""
TURN = 0.03
"""[rad] by which no body turns in a part that is not looked at; the disc above turns so far."""


@compiled
def survey(plant: Opened, q: Row, v: Row) -> tuple[float, float, int]:
    """Return what a plant stores at q (nq,), v (nv,) [J]; the deepest body, and its gap.

    Stored are the kinetic energy of links and rotors, gravity's, and that of springs in gears and
    compliant contacts. The gap is
    that of the origin of the joint that carries a body, from the nearest solid that loops know.
    """
    tree, placed, gears = plant.tree, plant.placed, plant.gears
    joints, poses, solids, m = tree.joints, placed.poses, plant.obstacles.solids, len(gears.rows)
    place(joints, tree.shapes, q, poses)
    about = point_of_reference(plant.flight.bases, poses)
    columns_at(joints, tree.shapes, poses, about, placed.columns)
    bodies_at(joints, tree.shapes, poses, about, placed.bodies)
    count, energy, deepest, lowest = len(joints), 0.0, np.inf, -1
    motion, momentum, motor, normal = np.empty((count, 6)), np.empty(6), np.empty(m), np.empty(3)
    motion_at(joints, placed.columns, v, motion)
    for i in range(count):
        body = placed.bodies[i]
        momentum_of(body, motion[i], momentum)
        energy += 0.5 * dot(momentum, motion[i])
        for k in range(3):
            energy -= tree.gravity[k] * (body[1 + k] + body[0] * about[k])
        gap = np.inf
        for s in range(len(solids)):
            gap = min(gap, solid_gap(solids[s], poses[i, 9:], normal))
        if body[0] > 0.0 and gap < deepest:
            deepest, lowest = gap, i
    motor_speeds(gears, v, motor)
    energy += rotor_energy(gears, v, motor)
    for g in range(m):
        if gears.numbers[g, STIFFNESS] < np.inf:
            energy += spring_energy(gears.numbers[g], gears.motion[g, DEFLECTION])
    if plant.bounds[HERTZ] > 0.0:
        plant.bounds[REACH] = AHEAD
        touch_ground(plant, np.zeros(0, dtype=np.bool_))
        plant.obstacles.stands[:] = np.nan
        for b in range(len(plant.obstacles.touch)):
            energy += stored_at(plant.bounds[HERTZ], -plant.obstacles.touch[b, 0])
    return energy, deepest, lowest


@compiled(inside=True)
def fastest_turn(plant: Opened, v: Row) -> float:
    """Return how fast a body turns at most [rad/s] at v (nv,), where the memory stands."""
    most, motion = 0.0, np.empty((len(plant.tree.joints), 6))
    motion_at(plant.tree.joints, plant.placed.columns, v, motion)
    for i in range(len(motion)):
        most = max(most, dot(motion[i, 3:], motion[i, 3:]))
    return sqrt(most)


@compiled(inside=True)
def slowed(plant: Opened, fast: Row, share: float, v: OutRow) -> float:
    """Write v (nv,) with a share of the joints' speeds, and the momentum; return what is stored."""
    for i in range(len(v)):
        v[i] = share * fast[i]
    set_momentum(plant.tree, plant.flight, plant.placed, v)
    energy, _, _ = survey(plant, plant.end.position, v)
    return energy


@compiled(inside=True)
def keep_passive(plant: Opened, start: Row, step: float) -> None:
    """Take from v (nv,) at the end of a part what it has made; it stands in books[TAKEN] [J].

    Args:
        plant: its memory stands at the end, with the books.
        start: v (nv,) at the start of the part.
        step: h [s].
    """
    end, motion, books, fast = plant.end, plant.gears.motion, plant.end.books, plant.end.velocity
    work = books[MOTOR]
    for i in range(len(fast)):
        work += 0.5 * step * end.force[i] * (end.speed[i] + end.after[i])
    had, _, _ = survey(plant, end.start, start)
    for i in range(len(motion)):
        motion[i, DEFLECTION], motion[i, SPEED] = end.deflection[i], end.motor_speed[i]
    has, _, _ = survey(plant, end.position, fast)
    most = had + work + MADE * (books[KINETIC] + abs(work))
    if has <= most:
        return
    given, v = fast.copy(), end.velocity
    none, half = slowed(plant, given, 0.0, v), slowed(plant, given, 0.5, v)
    # Stored energy is quadratic in the share: none + along share + square share^2.
    square, along = 2.0 * (has + none - 2.0 * half), 4.0 * half - has - 3.0 * none
    if none < most:
        root = along + sqrt(max(along * along + 4.0 * square * (most - none), 0.0))
        share = 2.0 * (most - none) / root if root > 0.0 else 1.0
        books[TAKEN] = has - slowed(plant, given, min(share, 1.0), v)
        return
    slowed(plant, given, 0.0, v)
    given[:] = 0.0
    rest, _, _ = survey(plant, end.position, given)
    share = sqrt((most - rest) / (none - rest)) if rest < most else 0.0
    for i in range(len(v)):
        v[i] *= share
    books[TAKEN] = has - rest - share * share * (none - rest)
