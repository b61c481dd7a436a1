"""What a search for the directions of gears asks of a program, compiled; and its first guess."""

from __future__ import annotations

from wbc.compiled import OutFlags, OutPlaces, OutRow, Places, Row, compiled, view
from wbc.control.memory import COUNT, GEAR, PART, ProgramMemory
from wbc.control.qp.active_set import BASE, START, STEPS, settle
from wbc.control.rows.gear_rows import place_efforts, place_output, place_torques
from wbc.mechanics.linear import dot

UNSOLVED, LIMITED_TORQUE, DONE = range(3)
"""How a guess ends: without a solution, with a torque limit, or well."""
GUESSES = 3
"""How often directions are turned over before they are searched."""
SMALL = 1e-6
"""[N m], output torque under which a gear's direction does not matter."""
_ACTIVE = 1e-6


@compiled(counted=False)
def try_bounds(
    program: ProgramMemory, start: int, steps: int, x: OutRow, y: OutRow, z: OutRow
) -> tuple[int, int]:
    """Solve from the bounds taken as binding, see `settle`; return what that does.

    Args:
        start: the first bound that the program has.
        steps: systems with other bounds that are solved at most.
        x, y, z: results, as in `QPSolution`.
    """
    solver, soft = program.solver, program.counts[COUNT.cost]
    base = soft + program.counts[COUNT.hard]
    solver.sizes[BASE], solver.sizes[START] = base, start
    size, took = settle(solver, steps, x)
    if size >= 0:
        z[:] = 0.0
        for i in range(soft, base):
            y[i - soft] = -solver.force[i]
        for k in range(size - base):
            z[solver.active[k]] = -solver.force[base + k]
    return size, took


@compiled
def guess(program: ProgramMemory, block: OutRow) -> int:
    """Solve from the rows that bound the last solution, without torque limits, and write torques.

    What efforts cost depends on the directions of the gears: those of the solution are taken.

    Returns:
        UNSOLVED, LIMITED_TORQUE or DONE.
    """
    slopes, ends, positive = program.gears.slopes, program.ends, program.positive
    rows = view(block, ends[PART.by_gear], len(GEAR), len(positive))
    output, share = rows[GEAR.output_torque], rows[GEAR.share]
    x = block[ends[PART.x] : ends[PART.x + 1]]
    y, z = block[ends[PART.y] : ends[PART.y + 1]], block[ends[PART.z] : ends[PART.z + 1]]
    for i in range(len(positive)):
        positive[i] = 1 if program.output[i] > 0.0 else 0
    size, turned, tries = -1, True, 0
    while turned and tries < GUESSES:
        turned, tries = False, tries + 1
        place_efforts(program, positive)
        size = try_bounds(program, 2 * len(program.limited), STEPS, x, y, z)[0]
        if size < 0 or len(program.efforts) == 0:
            break
        place_output(program, x, output, share)
        for i in range(len(positive)):
            differs = (output[i] > 0.0) != (positive[i] != 0) and slopes[0, i] != slopes[1, i]
            if differs and abs(output[i]) > SMALL:
                positive[i], turned = 1 - positive[i], True
    if size < 0 or turned:
        return UNSOLVED
    return DONE if place_torques(program, block) else LIMITED_TORQUE


@compiled(counted=False)
def weigh(
    program: ProgramMemory, x: Row, choice: Places, output: OutRow, share: OutRow, beyond: OutFlags
) -> tuple[float, bool]:
    """Write T of x (n,), what the rotors take, and which gears the mesh law takes beyond limits.

    Args:
        x: (n,).
        choice: directions (m,) of the program; gears that are decided are not beyond.
        output, share, beyond: results (m,).

    Returns:
        the cost of x, where what must be kept costs nothing, and whether any gear is beyond.
    """
    gears, solver, counts, cost, some = program.gears, program.solver, program.counts, 0.0, False
    place_output(program, x, output, share)
    for i in range(len(choice)):
        torque = gears.slopes[1 if output[i] > 0.0 else 0, i] * output[i] + share[i]
        slack = 1e-5 * (1.0 + abs(torque))
        beyond[i] = torque < gears.lower[i] - slack or torque > gears.upper[i] + slack
        beyond[i] = beyond[i] and choice[i] == 0
        some = some or beyond[i]
    for j in range(len(x)):
        cost += (0.5 * solver.diagonal[j] * x[j] - solver.pull[j]) * x[j]
    for i in range(counts[COUNT.cost]):
        miss = dot(solver.rows[i], x) - solver.right[i]
        cost += 0.5 * miss * miss / solver.softness[i]
    return cost, some


@compiled
def contested(
    program: ProgramMemory, z: Row, choice: Places, decided: Places, sides: OutPlaces
) -> int:
    """Write the directions (m,) of gears whose half-space binds, 0 elsewhere; return how many.

    With those directions a solution with multipliers z is the best, whatever the others are.

    Args:
        z: multipliers (r,) of the bounds.
        choice, decided: directions (m,) of the program, and those that are not to be revised.
    """
    count, found = len(program.limited), 0
    sides[:] = 0
    for i in range(count):
        gear = program.limited[i]
        steeper = program.gears.slopes[1, gear] - program.gears.slopes[0, gear]
        if choice[gear] == 0 or decided[gear] != 0 or steeper == 0.0:
            continue
        push = z[i + count if choice[gear] > 0 else i]
        if (-push if steeper > 0.0 else push) > _ACTIVE:
            sides[gear], found = choice[gear], found + 1
    return found
