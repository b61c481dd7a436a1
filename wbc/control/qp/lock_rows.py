"""What a more important level has decided, as rows that the next one keeps, compiled."""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Any

import numpy as np
from scipy.optimize import nnls

from wbc.compiled import OutDense, OutPlaces, OutRow, Row, compiled
from wbc.control.memory import COUNT, NUMBER, ProgramMemory, TasksMemory
from wbc.control.qp.active_set import place_row
from wbc.control.qp.linalg import extend_basis
from wbc.control.qp.solvers import INFINITE
from wbc.mechanics.linear import dot
from wbc.structures import Structure

_HALF = 0.5
# Half an angle, of a wedge that counts as closed: what is free is measured by what it costs, as a
# dual method does. With 3e-5 all of 2080 ticks of Talos are solved and the cost is at most 0.5 %
# larger than with the wedge open, with 1e-5 six are not, and with 1e-4 it is 0.6 % on fewer states.
_NARROW = 3e-5

# Memory of `hold`: the rows of all more important tasks (a, n), and room for as many rows as there
# are equalities, bounds and variables. `ends` (3,): how many orthonormal rows in `kept` are
# equalities of the robot, and of tasks as well; how many bounds in `binding` are reached.
LOCK = Structure(
    "Lock",
    (OutDense, "above", "a", "n"),
    (OutDense, "left kept scaled free", "k", "n"),
    (OutDense, "binding", "r", "n"),
    (OutPlaces, "places decided", "r"),
    (OutRow, "scales", "n"),
    (OutPlaces, "ends", 3),
)
LockMemory = Annotated[Any, LOCK.kind]


@compiled
def place_above(tasks: TasksMemory, rows: OutDense, start: int) -> int:
    """Write what a level's tasks decide below row `start` of (a, n); return where that ends."""
    jacobian, weights = tasks.rows.jacobian, tasks.weights
    count, nv = jacobian.shape[0], jacobian.shape[1]
    for i in range(count):
        for j in range(nv):
            rows[start + i, j] = jacobian[i, j] if weights[i] > 0.0 else 0.0
    for i in range(len(tasks.chosen)):
        column = tasks.chosen[i]
        rows[start + count + i, column] = 1.0 if tasks.diagonal[column] > 0.0 else 0.0
    return int(start + count + len(tasks.chosen))


@compiled(counted=False)
def _gather_binding(program: ProgramMemory, lock: LockMemory, start: int, x: Row) -> int:
    """Write the bounds from `start` on that x (n,) has reached: outwards, scaled, of length one."""
    C, lower, upper = program.solver.C, program.stated_lower, program.stated_upper
    binding, scales, count, reach = lock.binding, lock.scales, 0, program.numbers[NUMBER.reach]
    for i in range(start, len(lower)):
        value, length = dot(C[i], x), 0.0
        for j in range(len(x)):
            length += (C[i, j] * scales[j]) ** 2
        high = value > upper[i] - reach
        if length > 0.0 and (high or value < lower[i] + reach):
            sign = (1.0 if high else -1.0) / sqrt(length)
            for j in range(len(x)):
                binding[count, j] = sign * C[i, j] * scales[j]
            lock.places[count], count = i, count + 1
    return count


def extend_by_bounds(lock: Any) -> None:
    """Add the bounds that no motion within the equalities leaves to these.

    With u_i what the equalities leave of row i, the direction d that minimises

        |d|^2 / 2 + sum s_i^2 / (2 r),      u_i d <= s_i - 1

    lets go of every row that can be let go of, with s_i near zero; of the others, which add up to
    nothing with positive weights, s_i is one. In between a wedge of half an angle a has
    s = r / (2 a^2 + r): sqrt(r / 2) is the half angle below which it counts as closed. With U the
    rows u_i, the multipliers w >= 0 of the rows minimise w'(U U' + r) w / 2 - sum w, and s = r w.
    """
    (_, last, count), n, root = lock.ends, len(lock.scales), sqrt(2.0) * _NARROW
    size = extend_basis(lock.kept[:last] * lock.scales, lock.left, lock.scaled, 0, n)
    left, implied = np.arange(count), np.ones(count, dtype=np.bool_)
    while left.size and implied.any():
        free = lock.binding[left]
        for _ in range(2):
            free -= (free @ lock.scaled[:size].T) @ lock.scaled[:size]
        system = np.vstack([free.T, root * np.eye(len(left))])
        right = np.concatenate([np.zeros(n), np.full(len(left), 1.0 / root)])
        implied = root**2 * nnls(system, right)[0] > _HALF
        found = lock.binding[left[implied]]
        size = extend_basis(found, lock.left, lock.scaled, size, n)
        lock.decided[lock.places[left[implied]]] = 1
        left = left[~implied]
    found = np.delete(lock.binding[:count], left, axis=0) / lock.scales
    lock.ends[1] = extend_basis(found, lock.left, lock.kept, last, n)


@compiled(counted=False)
def let_pass(program: ProgramMemory, lock: LockMemory, x: Row, start: int, stop: int) -> None:
    """Move the bounds of rows from `start` to `stop` to where x (n,) is, as far as they may.

    Then the solution of the level above is one of this level, and no gap of the tolerance's size
    parts bounds that meet. A bound that has become an equality is none any more.
    """
    solver = program.solver
    for i in range(start, stop):
        # limits of joints and distances may have given way above
        room = np.inf if i >= program.joint else program.numbers[NUMBER.reach]
        if lock.decided[i] != 0:
            solver.lower[i], solver.upper[i] = -INFINITE, INFINITE
            continue
        low, high, value = program.stated_lower[i], program.stated_upper[i], dot(solver.C[i], x)
        solver.upper[i] = high + min(max(value - high, 0.0), room)
        solver.lower[i] = low - min(max(low - value, 0.0), room)


@compiled
def _forces_balance(program: ProgramMemory, lock: LockMemory) -> bool:
    """Whether contact forces meet the balance of the undriven coordinates at every qdd."""
    jacobian, undriven = program.contacts.rows.jacobian, program.undriven
    for i in range(len(undriven)):
        for j in range(len(jacobian)):
            lock.free[i, j] = jacobian[j, undriven[i]]
    forces, count = len(jacobian), len(undriven)
    spanned: int = extend_basis(lock.free[:count], lock.left, lock.kept, 0, forces)
    return spanned == count


@compiled(counted=False)
def place_lock(program: ProgramMemory, lock: LockMemory, x: Row, width: int) -> int:
    """Write the rows of `kept` that are not the robot's own; arguments and result as for `hold`.

    `width` is how many of the variables they are about.
    """
    solver, counts, first, last = program.solver, program.counts, lock.ends[0], lock.ends[1]
    counts[COUNT.hard] = counts[COUNT.own] + last - first
    for i in range(first, last):
        row, place = lock.kept[i, :width], counts[COUNT.cost] + counts[COUNT.own] + i - first
        place_row(solver, place, row, dot(row, x), 0.0)
    let_pass(program, lock, x, 2 * len(program.limited), len(solver.give))
    return int(width - last)


@compiled
def hold(program: ProgramMemory, lock: LockMemory, x: Row, limited: bool) -> int:
    """Write the rows that hold what x (n,) of the level above gives its tasks.

    The tasks may ask for more than the robot has freedoms, and the contacts and the balance of the
    undriven coordinates take some of those away. Only what the tasks' rows add to the equalities
    is locked, as orthonormal rows: as many as there are decisions, however they were asked for,
    and none that could contradict another. Tasks are of qdd alone: a balance that forces meet in
    any case is none of their business, unless bounds that also limit forces join in.

    Where bounds kept the tasks from more, most of these bounds cannot be left either without losing
    something of the tasks (Escande, Mansard & Wieber, 2014): rows that add up to nothing with
    positive weights. As inequalities they have no room between them, and pushes without limit.
    They are locked as well (`extend_by_bounds`, then `place_lock`), and are no bounds any more.

    Args:
        program: PROGRAM, evaluated.
        lock: LOCK, with `above` written.
        x: (n,).
        limited: whether torque limits may bind; their rows are then those of x.

    Returns:
        how many freedoms of qdd, or of x, are left; -1 where bounds are still to be locked.
    """
    solver, scales = program.solver, lock.scales
    start = 0 if limited else 2 * len(program.limited)
    top, nv, n = program.counts[COUNT.cost], len(program.tasks.diagonal), len(x)
    for j in range(n):
        weight = program.tasks.diagonal[j] if j < nv else solver.diagonal[j]
        scales[j] = 1.0 / sqrt(weight + program.numbers[NUMBER.regular])
    reached = _gather_binding(program, lock, start, x)
    own, width = top, n
    if reached == 0 and _forces_balance(program, lock):
        own, width = top + len(program.undriven), nv
    lock.decided[:] = 0
    equalities = solver.rows[own : top + program.counts[COUNT.own]]
    first = extend_basis(equalities, lock.left, lock.kept, 0, width)
    last = extend_basis(lock.above, lock.left, lock.kept, first, width)
    lock.ends[0], lock.ends[1], lock.ends[2] = first, last, reached
    if reached > 0 and last < n:
        return -1
    return place_lock(program, lock, x, width)
