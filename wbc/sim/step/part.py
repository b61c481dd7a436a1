"""One smooth part of a step: both halves, and the rows between them (see `part_rows`)."""

from __future__ import annotations

import numpy as np

from wbc.compiled import Places, Row, ask, compiled, inner
from wbc.mechanics.linear import add_times, dot
from wbc.mechanics.newton import UNSOLVED
from wbc.sim.step.arrival import arrive
from wbc.sim.step.books import TURN, books_of, fastest_turn, keep_passive
from wbc.sim.step.contacts import gaps_at
from wbc.sim.step.motion import to_middle
from wbc.sim.step.pairs import FAR
from wbc.sim.step.part_rows import PartRows, rows_of, world_pushes
from wbc.sim.step.solution import NO_INERTIA, solve_part
from wbc.sim.step.tables import HERTZ, LENGTH, TOUCH, Opened

SMOOTH, LANDED = 1, 2
"""A part to the end; one in which a barrier was passed on the way."""

_FASTEST = 10.0

_MESH_ROUNDS = 40
_MESH_TOLERANCE = 1e-9  # of the torque that a gear carries; steps are solved to 1e-10
# Change of what a gear carries per change of what its loss assumes: below it lies a loss of 95 % of
# the power forward, above it one of 95 % backward; beyond them is rounding.
_LEAST_SLOPE, _MOST_SLOPE = -19.0, 0.95

_ROUNDING = 1e-12
"""Share of all pushes that is none: what opens is not held back by an impulse of 1e-20 N s."""


@inner
def begin(plant: Opened, step: float) -> PartRows:
    """Return the rows of a part, which start from the last step's impulses.

    Where H_l is not positive, `lower[0, 0]` is no number. Compliant contacts take part that may be
    met within it: `_FASTEST` [m/s]. One that comes faster is met by the part after, deeper in its
    spring.

    Args:
        plant: whose memory stands in the middle; which barriers hold is written.
        step: h [s].
    """
    end, before = plant.end, plant.now.closed
    for i in range(len(before)):
        end.closed[i] = before[i] or end.kept[i]
    if plant.bounds[HERTZ] > 0.0:
        gaps_at(plant, end.before, before[:0], end.gap)
        for i in range(plant.obstacles.limits, len(before)):
            end.closed[i] = end.gap[i] < 0.5 * step * _FASTEST
    rows = rows_of(plant, step)
    for i in range(len(rows.start)):
        rows.start[i] = plant.now.impulse[rows.places[i]]
    return rows


@inner
def keep(plant: Opened, rows: PartRows) -> None:
    """Write the impulses after which a part ends, and how the motors move then."""
    end, half = plant.end, 0.5 * rows.step
    end.impulse[:] = 0.0
    for i in range(len(rows.impulse)):
        end.impulse[rows.places[i]] = rows.impulse[i]
    for i in range(len(rows.motor)):
        end.motor_speed[i] = rows.speed[i] + rows.end[i]
        end.mesh_impulse[i] = rows.impulse[i] + np.sign(end.motor_speed[i]) * rows.laws[i, 5]
        end.deflection[i] = 0.0
        if plant.gears.yields[i]:
            moved = half * (rows.relative[i] + rows.end[i])
            end.deflection[i] = plant.now.deflection[i] + moved


@inner
def hold_or_land(plant: Opened, held: Places, pushes: Row) -> int:
    """Write which barriers stay closed, pressed ones or in touch; return LANDED or SMOOTH.

    One that is passed by more than a touch has landed. Compliant ones neither close nor land.

    Args:
        plant: with the gaps of the end.
        held: (l + k,) numbers of the closed limits and normals.
        pushes: (l + k,) their impulses.
    """
    result, rigid = SMOOTH, plant.obstacles.rigid
    gap, closed = plant.end.gap, plant.end.closed
    for i in range(rigid):
        if gap[i] < -TOUCH and not closed[i]:
            result = LANDED
    for row in range(len(held)):
        i = held[row]
        closed[i] = i < rigid and (gap[i] <= TOUCH or (pushes[row] > 0.0 and gap[i] < FAR))
    return result


@inner
def part_of_step(plant: Opened, step: float) -> int:
    """Do a part from the state of the plant.

    Python is asked for what acts in the middle where loops do not know it.

    Args:
        plant: what moves, with the forces, the state at the start, and the barriers that may close
            within the part, `plant.end.kept`; the rest of `plant.end` is written.
        step: h [s].

    Returns:
        SMOOTH or LANDED; ten and more where it failed, ten beyond what `solve_part` says.
    """
    end = plant.end
    to_middle(plant, 0.5 * step)
    plant.now.numbers[LENGTH] = step
    if plant.forces.asked != 0:
        ask(plant.forces.asked)
    rows = begin(plant, step)
    if not rows.lower[0, 0] > 0.0:
        return 10 + NO_INERTIA
    way = solve_part(plant, rows, end.speed, 1.0)
    keep(plant, rows)
    if way >= UNSOLVED:
        return 10 + way
    books_of(plant, rows)
    elements, both = len(rows.laws), len(rows.targets)
    turns = fastest_turn(plant, end.speed) + fastest_turn(plant, end.after)
    world_pushes(plant, rows)
    pressed = rows.impulse[elements : elements + both]
    rounding = 0.0
    for i in range(both):
        rounding += _ROUNDING * abs(pressed[i])
    for i in range(both):
        pressed[i] = pressed[i] if pressed[i] > rounding else 0.0
    arrive(plant, rows, pressed)
    if not np.isfinite(np.sum(end.velocity)):  # it blew up on the way
        return 10 + NO_INERTIA
    for i in range(len(end.motor_speed) if plant.gears.loose else 0):
        if plant.gears.yields[i]:  # motors stay where they are
            end.deflection[i] -= dot(end.moved, plant.gears.rows[i])
    if not 0.5 * step * turns <= TURN:
        keep_passive(plant)
    return hold_or_land(plant, rows.held, pressed)


@compiled(inside=True)
def part_with_mesh(plant: Opened, step: float) -> int:
    """Do a part in which effects see the torque that the gears then carry, see `part_of_step`.

    Secant steps of each gear alone, from what its effect remembers of the step before: what a gear
    carries is nearly linear in what it is taken to carry, and other gears change it little.
    """
    taken, mesh = plant.forces.mesh, plant.end.mesh_impulse
    taken[:] = np.nan
    result = part_of_step(plant, step)
    if len(taken) == 0 or result >= 10:
        return result
    miss, change, slope = np.zeros(len(taken)), np.zeros(len(taken)), np.zeros(len(taken))
    for i in range(len(taken)):
        taken[i] = mesh[i] / step
    for _ in range(_MESH_ROUNDS):
        result, met = part_of_step(plant, step), True
        for i in range(len(taken)):
            carried, last = mesh[i] / step, miss[i]
            miss[i] = carried - taken[i]
            met = met and abs(miss[i]) <= _MESH_TOLERANCE * (1.0 + abs(carried))
            if change[i] != 0.0:
                slope[i] = min(max(1.0 + (miss[i] - last) / change[i], _LEAST_SLOPE), _MOST_SLOPE)
            change[i] = miss[i] / (1.0 - slope[i])
        if met or result >= 10:
            break
        add_times(1.0, change, taken)
    return result
