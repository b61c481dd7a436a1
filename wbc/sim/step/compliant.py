"""Compliant contacts: Hunt and Crossley's law, solved with all other rows of a part.

F = K d^(3/2) (1 + 3/2 a d') for a depth d > 0 that grows at d' [m/s], never pulling (K. Hunt and
F. Crossley, *Coefficient of Restitution Interpreted as Damping in Vibroimpact*, J. Applied
Mechanics 42, 1975). Over a part the depth goes from d0 to d1, and the impulse is

    h (U(d1) - U(d0))/(d1 - d0) (1 + 3/2 a (d1 - d0)/h),    U = 2/5 K d^(5/2),

so that what the spring takes and gives back is exact at any step, and the rest is lost. d1 is
linear in the speed at which the contact opens, and the impulse is a convex function of it. Its
tangent is a rigid row with a compliance and a target speed. Newton's iteration puts each contact's
tangent where the rows then take it; begun at the deepest place, it comes nearer from one side.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import Count, Number, Row, compiled, several
from wbc.mechanics.newton import UNSOLVED, speeds_at
from wbc.mechanics.rows import SYSTEM, RowSystem
from wbc.sim.step.flanks import solve_gripped
from wbc.sim.step.part_rows import ROWS, SOLVED, PartRows, Solved
from wbc.sim.step.tables import DISSIPATION, HERTZ, OPENED, Opened

_ROUNDS = 60
NEVER = -1e9
"""[m/s] lowest speed of a row that no contact holds."""
_NEAR = 1e-5  # share of a depth below which a difference quotient is the slope in the middle


@compiled(Number, Number, Number, counted=False)
def stored_at(stiffness: float, depth: float) -> float:
    """Return what a contact stores at a depth [m]: U, none outside."""
    return 0.4 * stiffness * depth * depth * sqrt(depth) if depth > 0.0 else 0.0


@compiled(several(Number, Number), OPENED, Number, Number, Number, counted=False)
def mean_force(plant: Opened, before: float, after: float, step: float) -> tuple[float, float]:
    """Return the mean force [N] between two depths [m], and its derivative by the second."""
    stiffness, way = plant.bounds[HERTZ], after - before
    if abs(way) <= _NEAR * max(abs(before), abs(after)):
        root = sqrt(max(0.5 * (before + after), 0.0))
        force, slope = stiffness * root**3, 0.75 * stiffness * root
    else:
        force = (stored_at(stiffness, after) - stored_at(stiffness, before)) / way
        slope = (stiffness * sqrt(max(after, 0.0)) ** 3 - force) / way
    rate = 1.5 * plant.bounds[DISSIPATION] / step
    share = 1.0 + rate * way
    if share <= 0.0 or force <= 0.0:
        return 0.0, 0.0
    return share * force, share * slope + rate * force


@compiled(several(Count, Count, Number), OPENED, ROWS, SYSTEM, Row, Number, Number, SOLVED)
def solve_compliant(
    plant: Opened,
    rows: PartRows,
    system: RowSystem,
    start: FloatArray,
    step: float,
    tolerance: float,
    solved: Solved,
) -> tuple[int, int, float]:
    """Solve the rows of a part with compliant contacts.

    Args:
        plant: what moves.
        rows, system, start, step, tolerance, solved: see `solve_gripped`.

    Returns:
        see `solve_gripped`.
    """
    depths, impulse = rows.depths, solved.impulse
    count, contacts = len(system.targets), len(depths)
    first, work, m = count - contacts, 0, len(system.laws)
    delassus, slope = system.delassus.copy(), system.slope.copy()
    targets, speed, guess = system.targets.copy(), system.free.copy(), start.copy()
    softer = RowSystem(
        system.half, np.empty((0, 0)), delassus, system.free, system.spring, slope,
        system.laws, targets, system.frictions, system.grips, system.tangents,
    )  # fmt: skip
    for _ in range(_ROUNDS):
        for c in range(contacts):
            row = m + first + c
            after = depths[c, 1] - 0.5 * step * speed[row]
            force, rise = mean_force(plant, depths[c, 0], after, step)
            stiff, push = 0.5 * step * step * rise, step * force
            own = system.delassus[row, row]
            give = 1.0 / stiff if stiff > 1e-12 / own else 0.0
            delassus[row, row] = own + give
            slope[row] = 1.0 / (own + give)
            targets[first + c] = speed[row] + push * give if give > 0.0 else NEVER
        used, way, missed = solve_gripped(plant.gears, rows, softer, guess, step, tolerance, solved)
        work += used
        if way >= UNSOLVED:
            return work, way, missed
        guess[:] = impulse
        speeds_at(system.delassus, system.free, impulse, speed)
        off = 0.0
        for c in range(contacts):
            row = m + first + c
            after = depths[c, 1] - 0.5 * step * speed[row]
            force, _ = mean_force(plant, depths[c, 0], after, step)
            off = max(off, abs(step * force - impulse[row]) * system.delassus[row, row])
        if off <= tolerance:
            return work, way, missed
    return work, UNSOLVED, 0.0
