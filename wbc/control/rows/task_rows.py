"""Rows of tasks in a tick, compiled: what is wanted of the accelerations."""

from __future__ import annotations

from math import sqrt

import numpy as np

from wbc.compiled import compiled, inner
from wbc.control.memory import COUNT, NUMBER, ProgramMemory
from wbc.control.qp.active_set import place_row
from wbc.control.rows.point_foot import balancing
from wbc.control.tree import (
    BALANCE,
    CENTER_OF_MASS,
    fill_state_rows,
    place_missing,
)
from wbc.mechanics.kinematics import placed_at
from wbc.mechanics.linear import add_times, dot

INSIDE = 0.1
"""Share of the way from an edge to the middle that a centre of mass at rest keeps from the edge."""
SWEEPS = 4
"""How often an acceleration is brought behind all edges: behind one it may be beyond another."""


@compiled
def keep_over_feet(program: ProgramMemory, vx: float, vy: float, row: int) -> None:
    """Take from the acceleration wanted of the centre of mass what would carry it off its feet.

    With b = sqrt(g / height), the contacts can bring the centre of mass c to rest as long as its
    capture point xi = c + c'/b lies in the hull of what they rest on. Behind an edge with the
    normal n at e, shrunk a little towards the middle of the hull, that stays so with

        n'c'' <= b (b (e - n'xi) - n'c').

    With fewer than three corners a robot balances on a line or a point, and nothing is taken.

    Args:
        program: PROGRAM.
        vx, vy: of the centre of mass [m/s].
        row: of what tasks want, where x of its acceleration stands, and y in the next; result.
    """
    tree, corners, rows = program.tree, program.contacts.corners, program.contacts.rows
    wanted, com, count = program.tasks.wanted, tree.com, len(corners)
    if count < 3:
        return
    points, mx, my, height = np.empty((count, 3)), 0.0, 0.0, com[2]
    for i in range(count):
        e = int(corners[i, 0])
        placed_at(rows.places[e], corners[i, 1:], points[i])
        add_times(-1.0, rows.offsets[e, 12:15], points[i])
        mx, my = mx + points[i, 0] / count, my + points[i, 1] / count
        height -= points[i, 2] / count
    if height <= 0.0:
        return
    pole = sqrt(-tree.gravity[2] / height)
    x, y = com[0] + vx / pole - mx, com[1] + vy / pole - my
    for _ in range(SWEEPS):
        kept = True
        for i in range(count):
            for j in range(count):
                nx, ny = points[j, 1] - points[i, 1], points[i, 0] - points[j, 0]
                size, outside = sqrt(nx * nx + ny * ny), 0.0
                for k in range(count):
                    along = nx * (points[k, 0] - points[i, 0]) + ny * (points[k, 1] - points[i, 1])
                    outside = max(outside, along)
                if size == 0.0 or outside > 1e-9 * size:
                    continue
                nx, ny = nx / size, ny / size
                edge = nx * (points[i, 0] - mx) + ny * (points[i, 1] - my)
                most = (1.0 - INSIDE) * edge - nx * x - ny * y
                most = pole * (pole * most - nx * vx - ny * vy)
                beyond = nx * wanted[row] + ny * wanted[row + 1] - most
                if beyond > 0.0:
                    kept = False
                    wanted[row] -= beyond * nx
                    wanted[row + 1] -= beyond * ny
        if kept:
            return


@inner
def want(program: ProgramMemory) -> None:
    """Write the rows of all tasks, and what they want (k + c,): gains * parts, fed back in limits.

    Errors of what follows from the state, and all rates, are written into `parts` first. A momentum
    is a rate itself. A centre of mass that is to rest somewhere stays over the feet on its way.
    """
    tree, tasks, velocity = program.tree, program.tasks, program.velocity
    mass = program.numbers[NUMBER.mass]
    fill_state_rows(tree, tasks.rows, mass)
    rows, parts, gains, targets = tasks.rows, tasks.parts, tasks.gains, tasks.targets
    wanted, pull, chosen, jacobian = tasks.wanted, tasks.pull, tasks.chosen, tasks.rows.jacobian
    plan, total = rows.plan, len(tasks.wanted)
    count = total - len(chosen)
    for i in range(count):
        parts[1, i], parts[2, i] = dot(jacobian[i], velocity), rows.drift[i]
    for e in range(len(plan)):
        if rows.used[e] == 0:
            continue
        if plan[e, 0] == BALANCE:
            parts[0, plan[e, 2]] = balancing(tree, rows, e, velocity, mass, targets[e, 9])
        else:
            place_missing(rows, e, targets[e], parts[1], parts[0])
    for i in range(len(chosen)):
        parts[1, count + i] = velocity[chosen[i]]
        parts[0, count + i] = tasks.goals[i] - program.position[tasks.positions[i]]
    for i in range(total):
        most = tasks.limits[i]
        back = min(max(gains[0, i] * parts[0, i], -most), most)
        back += gains[1, i] * parts[1, i] + gains[3, i] * parts[3, i]
        ahead = gains[2, i] * parts[2, i] + gains[4, i] * parts[4, i]
        wanted[i] = min(max(back, -most), most) + ahead
    for e in range(len(plan)):
        row, both = plan[e, 2], plan[e, 3] == 0 and plan[e, 4] > 1 and plan[e, 5] == 1
        limited = both and rows.used[e] != 0 and tasks.limits[row] < np.inf
        if plan[e, 0] == CENTER_OF_MASS and limited:
            moves = abs(parts[3, row]) + abs(parts[3, row + 1])
            if moves + abs(parts[4, row]) + abs(parts[4, row + 1]) == 0.0:
                keep_over_feet(program, parts[1, row], parts[1, row + 1], row)
    pull[:] = 0.0
    for i in range(len(chosen)):
        pull[chosen[i]] += tasks.weights[count + i] * wanted[count + i]


@inner
def place_tasks(program: ProgramMemory) -> float:
    """Write the rows of tasks that have a weight, and the diagonal; leave room for efforts.

    Returns:
        the sum of the sizes of everything wanted.
    """
    tasks, solver, count, total = program.tasks, program.solver, 0, 0.0
    for i in range(len(tasks.rows.jacobian)):
        total += abs(tasks.wanted[i])
        if tasks.weights[i] > 0.0:
            softness = 1.0 / tasks.weights[i]
            place_row(solver, count, tasks.rows.jacobian[i], tasks.wanted[i], softness)
            count += 1
    for j in range(len(tasks.diagonal)):
        solver.diagonal[j] = tasks.diagonal[j] + program.numbers[NUMBER.regular]
        solver.pull[j] = tasks.pull[j]
        total += abs(tasks.pull[j])
    program.counts[COUNT.cost] = count + len(program.efforts) * len(program.map)
    return total
