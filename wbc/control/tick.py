"""One tick, compiled: from a state to rotor torques. Every tick of every controller passes here.

What only Python can say (a user's own task or effect, distances of solids) is written into the
structures before; what the rows that bound the last solution do not solve is left to a solver.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Any

import numpy as np

from wbc.compiled import (
    Count,
    Dense,
    OutDense,
    OutPlaces,
    OutRow,
    Places,
    Row,
    Vector,
    compiled,
    inner,
    view,
)
from wbc.control.qp.active_set import STEPS, SolverMemory, place_multipliers, place_row, settle
from wbc.control.qp.gear_rows import GearsMemory, place_loads, place_map, place_output
from wbc.control.qp.solvers import INFINITE
from wbc.control.rows.limits import JointsMemory, place_joint_bounds
from wbc.control.rows.point_foot import balancing
from wbc.control.tree import (
    BALANCE,
    CENTER_OF_MASS,
    RowsMemory,
    TreeMemory,
    fill_state_rows,
    move_joints,
    place_missing,
)
from wbc.effects.tables import fill_commands
from wbc.mechanics.kinematics import placed_at
from wbc.mechanics.linear import add_times, dot
from wbc.structures import Structure

TASKS = Structure(
    "Tasks",
    rows=RowsMemory,
    targets=Dense,
    chosen=Places,
    positions=Places,
    goals=Row,
    gains=Dense,
    limits=Row,
    weights=Row,
    parts=OutDense,
    wanted=(OutRow, "k"),
    diagonal=(Row, "v"),
    pull=(OutRow, "v"),
)
"""The tasks of a level: k rows J qdd = wanted, and c rows that select coordinates.

targets (e, 12) as placements; chosen (c,) coordinates, where q holds their positions, and goals
(c,); gains and parts (5, k + c) of error, rate, drift,
velocity and acceleration; limits of what is fed back, weights and wanted (k + c,); of the selecting
rows also the summed weights (nv,) and, as a result, the weighted pull (nv,).
"""
TasksMemory = Annotated[Any, TASKS.kind]

CONTACTS = Structure("Contacts", rows=RowsMemory, damping=Row, target=OutRow, corners=Dense)
"""The contacts that are active: rows J qdd = target (k,), with damping (k,) [1/s].

corners (c, 4): number of the entry of the rows, and a point of its frame [m] on which it rests.
"""
ContactsMemory = Annotated[Any, CONTACTS.kind]

PROGRAM = Structure(
    "Program",
    tree=TreeMemory,
    tasks=TasksMemory,
    contacts=ContactsMemory,
    gears=GearsMemory,
    joints=JointsMemory,
    solver=SolverMemory,
    limited=Places,
    map=(OutDense, "m", "n"),
    output_bias=(OutRow, "m"),
    undriven=Places,
    joint=Count,
    counts=(OutPlaces, 2),
    ends=Places,
    numbers=Row,
    efforts=Dense,
    effort_kinds=Dense,
    output=(OutRow, "m"),
    positive=(OutPlaces, "m"),
    stated_lower=OutRow,
    stated_upper=OutRow,
)
"""The program of one level for one set of contacts. Its rows: tasks, efforts, balance of the
undriven coordinates, contacts, what a more important level has decided.

`efforts` (e, m) are weights, of N tau_phi where the first of `effort_kinds` (e, 2) is one, of T
where it is zero, and of what the mesh loses where the second one, a least torque, is not zero. They
read T of the last tick and, in `positive` (m,), whether T > 0. T = map x + output_bias. `limited`
(g,) are the gears that have a torque limit, whose rows are the first 2 g bounds; those of joints
and distances begin at `joint`. The stated bounds are those of the solver but where a more important
level has to pass. Part p of a block of results stands from ends[p] to ends[p + 1].
"""
ProgramMemory = Annotated[Any, PROGRAM.kind]

COST, HARD = range(2)
"""`counts`: rows of tasks and efforts, and hard rows below them."""

MASS, SCALE, REGULAR, TOLERANCE, GREATEST = range(5)
"""`numbers`: [kg], [N] per unit of force, weight of qdd, tolerance, greatest right side."""

POSITION, VELOCITY, CORRECTED, ADVANCED, GEARS, X, Z, Y = range(8)
"""Parts of a block: q, v, v corrected and expected next, the rows of the gears, x, z and y. What
stands before x is the same in every program of a controller, so that a tick reads there what the
last one came to, whatever its contacts were."""

TURNING, SIGMA, OUTPUT, SHARE, MESH, TORQUE_ROW, DRIVE = range(7)
"""Rows of gears in a block: expected dpsi, certainty, T, what the rotors
take, t, N tau_phi within the limits, and what the drives are told."""
GEAR_ROWS = 7

UNSOLVED, LIMITED_TORQUE, DONE = range(3)
"""How a guess ends: without a solution, with a torque limit, or well."""

INSIDE = 0.1
"""Share of the way from an edge to the middle that a centre of mass at rest keeps from the edge."""
SWEEPS = 4
"""How often an acceleration is brought behind all edges: behind one it may be beyond another."""
GUESSES = 3
"""How often directions are turned over before they are searched."""
SMALL = 1e-6
"""[N m], output torque under which a gear's direction does not matter."""


@compiled
def keep_over_feet(
    tree: TreeMemory, contacts: ContactsMemory, vx: float, vy: float, wanted: OutRow, row: int
) -> None:
    """Take from the acceleration wanted of the centre of mass what would carry it off its feet.

    With b = sqrt(g / height), the contacts can bring the centre of mass c to rest as long as its
    capture point xi = c + c'/b lies in the hull of what they rest on. Behind an edge with the
    normal n at e, shrunk a little towards the middle of the hull, that stays so with

        n'c'' <= b (b (e - n'xi) - n'c').

    With fewer than three corners a robot balances on a line or a point, and nothing is taken.

    Args:
        tree, contacts: TREE and CONTACTS.
        vx, vy: of the centre of mass [m/s].
        wanted: x and y of its acceleration in `row` and the next; result.
        row: number of x.
    """
    corners, rows, count, com = contacts.corners, contacts.rows, len(contacts.corners), tree.com
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
def want(
    tree: TreeMemory,
    tasks: TasksMemory,
    contacts: ContactsMemory,
    position: Row,
    velocity: Row,
    mass: float,
) -> None:
    """Write what all tasks want (k + c,): gains * parts, what is fed back within its limits.

    Errors of what follows from the state, and all rates, are written into `parts` first. A momentum
    is a rate itself. A centre of mass that is to rest somewhere stays over the feet on its way.

    Args:
        tree, tasks, contacts: TREE, TASKS and CONTACTS.
        position, velocity: q (nq,) and v (nv,).
        mass: of the robot [kg].
    """
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
        parts[0, count + i] = tasks.goals[i] - position[tasks.positions[i]]
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
                keep_over_feet(tree, contacts, parts[1, row], parts[1, row + 1], wanted, row)
    pull[:] = 0.0
    for i in range(len(chosen)):
        pull[chosen[i]] += tasks.weights[count + i] * wanted[count + i]


@compiled(counted=False)
def rest(tree: TreeMemory, contacts: ContactsMemory, velocity: Row, mass: float) -> None:
    """Write the rows of contacts, and -damping J v - drift (k,), which brings them to rest."""
    fill_state_rows(tree, contacts.rows, mass)
    jacobian, drift = contacts.rows.jacobian, contacts.rows.drift
    for i in range(len(drift)):
        contacts.target[i] = -contacts.damping[i] * dot(jacobian[i], velocity) - drift[i]


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
        solver.diagonal[j] = tasks.diagonal[j] + program.numbers[REGULAR]
        solver.pull[j] = tasks.pull[j]
        total += abs(tasks.pull[j])
    program.counts[COST] = count + len(program.efforts) * len(program.map)
    return total


@inner
def place_balance(program: ProgramMemory) -> float:
    """Write (M qdd - scale J' f)_undriven = -bias_undriven, and the rows of contacts.

    Returns:
        the sum of the sizes of what stands on the right.
    """
    gears, solver, at, total = program.gears, program.solver, program.counts[COST], 0.0
    jacobian, target, nv = program.contacts.rows.jacobian, program.contacts.target, len(gears.bias)
    for row in program.undriven:
        place_row(solver, at, gears.mass[row], -gears.bias[row], 0.0)
        for k in range(len(jacobian)):
            solver.rows[at, nv + k] = -program.numbers[SCALE] * jacobian[k, row]
        at, total = at + 1, total + abs(gears.bias[row])
    for k in range(len(jacobian)):
        place_row(solver, at + k, jacobian[k], target[k], 0.0)
        total += abs(target[k])
    return total


@compiled(counted=False)
def place_efforts(program: ProgramMemory, positive: Places) -> None:
    """Write the rows of efforts for directions (m,) of T, see `Effort`.

    They are root weight (e T + rotor share) or root weight T; what the mesh loses is a parabola.
    """
    gears, solver, m = program.gears, program.solver, len(program.map)
    row = program.counts[COST] - len(program.efforts) * m
    for effort in range(len(program.efforts)):
        rotor, least = program.effort_kinds[effort, 0], program.effort_kinds[effort, 1]
        for i in range(m):
            e, weight = gears.slopes[min(positive[i], 1), i], program.efforts[effort, i]
            if least > 0.0:
                rate = abs(e - 1.0) * abs(gears.turning[i])
                weight *= rate / max(abs(program.output[i]), least)
            root = sqrt(weight)
            slope = root * (e if rotor > 0.0 else 1.0)
            solver.rows[row] = 0.0
            add_times(slope, program.map[i], solver.rows[row])
            add_times(rotor * root, gears.rotor[i], solver.rows[row])
            right = slope * program.output_bias[i] + rotor * root * gears.rotor_bias[i]
            solver.right[row], solver.softness[row] = -right, 1.0
            row += 1


@compiled(counted=False)
def place_directed_rows(program: ProgramMemory, choice: Places) -> None:
    """Write the convex rows of all gears, and one half-space of some; call after the map.

    A row is lower <= slope T + rotor qdd + rotor_bias <= upper of a gear. N tau_phi is convex in T
    where the slope for T > 0 is the larger one: its upper limit is then two rows, its lower one a
    union. In a gear that turns the other way it is the reverse. The rows for T <= 0 stand in front,
    those for T > 0 behind them.

    Args:
        program: PROGRAM, with the slopes written.
        choice: (m,) 1 where the half-space is that of T > 0, -1 where that of T < 0, 0 where
            there is none.
    """
    gears, C, count = program.gears, program.solver.C, len(program.limited)
    slopes, lower, upper = gears.slopes, program.stated_lower, program.stated_upper
    for i in range(count):
        gear = program.limited[i]
        steeper = slopes[1, gear] - slopes[0, gear]
        for side in range(2):
            row, slope = i + side * count, slopes[side, gear]
            C[row] = 0.0
            add_times(slope, program.map[gear], C[row])
            add_times(1.0, gears.rotor[gear], C[row])
            offset = slope * program.output_bias[gear] + gears.rotor_bias[gear]
            both = choice[gear] == 2 * side - 1 if steeper != 0.0 else side == 0
            has_low, has_high = both or steeper < 0.0, both or steeper > 0.0
            lower[row] = gears.lower[gear] - offset if has_low else -INFINITE
            upper[row] = gears.upper[gear] - offset if has_high else INFINITE


@compiled(counted=False)
def finish(program: ProgramMemory, dt: float, block: OutRow) -> int:
    """Write what a solution leads to: torques, drive commands, the velocity expected next.

    Args:
        program: PROGRAM.
        dt: time until the next tick [s].
        block: holds x; results.

    Returns:
        DONE, or LIMITED_TORQUE where the limits did not leave all of it.
    """
    gears, ends, load, ended = program.gears, program.ends, program.joints.load, DONE
    x, velocity = block[ends[X] : ends[X + 1]], block[ends[CORRECTED] : ends[CORRECTED + 1]]
    rows = view(block, ends[GEARS], GEAR_ROWS, len(gears.driven))
    advanced, jacobian, nv = block[ends[ADVANCED] :], program.contacts.rows.jacobian, len(velocity)
    for i in range(nv):
        advanced[i] = velocity[i] + dt * x[i]
    for i in range(len(gears.driven) if len(load) > 0 else 0):
        row = gears.driven[i]
        load[row] = gears.bias[row]
        for k in range(len(jacobian)):
            load[row] -= program.numbers[SCALE] * jacobian[k, row] * x[nv + k]
    place_output(gears, program.map, program.output_bias, x, rows[OUTPUT], rows[SHARE])
    for i in range(len(gears.driven)):
        rows[TURNING, i], rows[SIGMA, i] = gears.turning[i], gears.sigma[i]
        rows[MESH, i] = gears.slopes[1 if rows[OUTPUT, i] > 0.0 else 0, i] * rows[OUTPUT, i]
        needed = rows[MESH, i] + rows[SHARE, i]
        rows[TORQUE_ROW, i] = min(max(needed, gears.lower[i]), gears.upper[i])
        if rows[TORQUE_ROW, i] != needed:
            rows[MESH, i], ended = rows[TORQUE_ROW, i] - rows[SHARE, i], LIMITED_TORQUE
        rows[DRIVE, i] = rows[TORQUE_ROW, i] * gears.inverse_ratio[i]
    fill_commands(gears.drives, rows[DRIVE], rows[DRIVE])
    return ended


@compiled(counted=False)
def try_bounds(
    program: ProgramMemory, start: int, steps: int, x: OutRow, y: OutRow, z: OutRow
) -> tuple[int, int]:
    """Solve from the bounds taken as binding, see `settle`; return what that does.

    Args:
        program: PROGRAM.
        start: the first bound that the program has.
        steps: systems with other bounds that are solved at most.
        x, y, z: results, as in `QPSolution`.
    """
    solver, soft = program.solver, program.counts[COST]
    base, bounds = soft + program.counts[HARD], (start, len(solver.give))
    size, took = settle(solver, base, bounds, program.numbers[TOLERANCE], steps, x)
    if size >= 0:
        place_multipliers(solver, base, soft, size, y, z)
    return size, took


@compiled
def solve(program: ProgramMemory, dt: float, block: OutRow) -> int:
    """Solve the program from the rows that bound the last solution; write what it leads to.

    Torque limits are left out. What efforts cost depends on the directions of the gears: those of
    the solution are taken.

    Args:
        program: PROGRAM.
        dt: time until the next tick [s].
        block: as `write` left it; results.

    Returns:
        UNSOLVED, LIMITED_TORQUE or DONE.
    """
    gears, ends, positive = program.gears, program.ends, program.positive
    rows, x = view(block, ends[GEARS], GEAR_ROWS, len(positive)), block[ends[X] : ends[X + 1]]
    y, z = block[ends[Y] : ends[Y + 1]], block[ends[Z] : ends[Z + 1]]
    size, turned, tries = -1, True, 0
    while turned and tries < GUESSES:
        turned, tries = False, tries + 1
        place_efforts(program, positive)
        size = try_bounds(program, 2 * len(program.limited), STEPS, x, y, z)[0]
        if size < 0 or len(program.efforts) == 0:
            break
        place_output(gears, program.map, program.output_bias, x, rows[OUTPUT], rows[SHARE])
        for i in range(len(positive)):
            differs = (rows[OUTPUT, i] > 0.0) != (positive[i] != 0)
            differs = differs and gears.slopes[0, i] != gears.slopes[1, i]
            if differs and abs(rows[OUTPUT, i]) > SMALL:
                positive[i], turned = 1 - positive[i], True
    if size < 0 or turned:
        return UNSOLVED
    return finish(program, dt, block)


@compiled
def write(
    program: ProgramMemory, position: Vector, velocity: Vector, last: Row, dt: float, block: OutRow
) -> bool:
    """Write everything that a state decides: tasks, contacts, loads, limits, balance.

    Args:
        program: PROGRAM.
        position, velocity: q (nq,) and v (nv,).
        last: block of the last tick, with v (nv,) [rad/s] expected of this state, and T.
        dt: time until the next tick [s].
        block: results.

    Returns:
        whether the numbers are finite, and small enough to solve with.
    """
    tree, gears, contacts, joints = program.tree, program.gears, program.contacts, program.joints
    ends, mass = program.ends, program.numbers[MASS]
    q, v = block[: ends[VELOCITY]], block[ends[VELOCITY] : ends[CORRECTED]]
    q[:], v[:] = position, velocity
    move_joints(tree, v)
    fill_state_rows(tree, program.tasks.rows, mass)
    rest(tree, contacts, v, mass)
    want(tree, program.tasks, contacts, q, v, mass)
    expected = last[ends[ADVANCED] : ends[ADVANCED + 1]]
    place_loads(gears, tree, q, v, expected, dt, block[ends[CORRECTED] : ends[ADVANCED]])
    scale, found = program.numbers[SCALE], (program.map, program.output_bias)
    place_map(gears, contacts.rows.jacobian, scale, *found)
    program.output[:] = view(last, ends[GEARS], GEAR_ROWS, len(gears.driven))[OUTPUT]
    for i in range(len(program.output)):
        program.positive[i] = 1 if program.output[i] > 0.0 else 0
    bounds = program.stated_lower[program.joint :], program.stated_upper[program.joint :]
    place_joint_bounds(joints, gears.bias, gears.mass, q, v, dt, bounds)
    total = place_tasks(program) + place_balance(program)
    return bool(total < program.numbers[GREATEST])
