"""What a more important level has decided, as rows that the next one keeps, compiled."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import (
    Count,
    Flag,
    Nothing,
    Number,
    OutDense,
    OutPlaces,
    OutRow,
    Row,
    compiled,
)
from wbc.control.qp.linalg import extend_basis, factorise, remove, substitute
from wbc.control.qp.problem import INFINITE
from wbc.control.tick import BOUNDS, COST, HARD, JOINT, PROGRAM, REGULAR, TASKS, TORQUE
from wbc.structures import Structure

_HALF = 0.5
_ROUNDING = 1e-9  # of a push or a pull, whose size is one
# Half an angle, of a wedge that counts as closed: what is free is measured by what it costs, as a
# dual method does. With 3e-5 all of 2080 ticks of Talos are solved and the cost is at most 0.5 %
# larger than with the wedge open, with 1e-5 six are not, and with 1e-4 it is 0.6 % on fewer states.
_NARROW = 3e-5

LOCK = Structure(
    "Lock",
    above=OutDense,
    left=OutDense,
    kept=OutDense,
    scaled=OutDense,
    binding=OutDense,
    places=OutPlaces,
    free=OutDense,
    products=OutDense,
    system=OutDense,
    push=OutRow,
    pull=OutRow,
    pushing=OutPlaces,
    scales=OutRow,
    decided=OutPlaces,
)
"""Memory of `hold`: the rows of all more important tasks (a, n), and room for as many rows as there
are equalities, bounds and variables."""


@compiled(Count, TASKS.kind, OutDense, Count)
def place_above(tasks: Any, rows: FloatArray, start: int) -> int:
    """Write what a level's tasks decide below row `start` of (a, n); return where that ends."""
    jacobian, weights = tasks.rows.jacobian, tasks.weights
    count, nv = jacobian.shape[0], jacobian.shape[1]
    for i in range(count):
        for j in range(nv):
            rows[start + i, j] = jacobian[i, j] if weights[i] > 0.0 else 0.0
    for i in range(len(tasks.chosen)):
        column = tasks.chosen[i]
        rows[start + count + i, column] = 1.0 if tasks.diagonal[column] > 0.0 else 0.0
    end: int = start + count + len(tasks.chosen)
    return end


@compiled(Count, PROGRAM.kind, LOCK.kind, Count, Row, Number)
def _gather_binding(program: Any, lock: Any, start: int, x: FloatArray, reach: float) -> int:
    """Write the bounds from `start` on that x (n,) has reached: outwards, scaled, of length one."""
    C, lower, upper = program.solver.C, program.stated_lower, program.stated_upper
    binding, scales, count = lock.binding, lock.scales, 0
    for i in range(start, program.counts[BOUNDS]):
        value, length = 0.0, 0.0
        for j in range(len(x)):
            value += C[i, j] * x[j]
            length += (C[i, j] * scales[j]) ** 2
        high = value > upper[i] - reach
        if length > 0.0 and (high or value < lower[i] + reach):
            sign = (1.0 if high else -1.0) / sqrt(length)
            for j in range(len(x)):
                binding[count, j] = sign * C[i, j] * scales[j]
            lock.places[count], count = i, count + 1
    return count


@compiled(Count, LOCK.kind, Count, Number)
def _correct(lock: Any, count: int, regular: float) -> int:
    """Solve with the rows taken as pushing; return how many were taken wrongly.

    Args:
        lock: LOCK; `pull` says of every row how far it is from being taken wrongly.
        count: how many rows there are.
        regular: as for `_place_pushes`.
    """
    products, push, pushing = lock.products, lock.push, lock.pushing
    system, left = lock.system, lock.pull
    size = 0
    for i in range(count):
        if pushing[i] != 0:
            column = 0
            for j in range(i + 1):
                if pushing[j] != 0:
                    system[size, column] = products[i, j]
                    column += 1
            system[size, size] += regular
            left[size] = 1.0
            size += 1
    factorise(system, size)
    substitute(system, size, left)
    size = 0
    for i in range(count):
        push[i] = 0.0
        if pushing[i] != 0:
            push[i] = left[size]
            size += 1
    wrong = 0
    for i in range(count):
        pull = -1.0
        if pushing[i] != 0:
            pull = push[i]
        else:
            for j in range(count):
                pull += products[i, j] * push[j]
        left[i] = pull
        wrong += pull < -_ROUNDING
    return wrong


@compiled(Nothing, LOCK.kind, Count, Number)
def _place_pushes(lock: Any, count: int, regular: float) -> None:
    """Write the w >= 0 (count,) that minimises w'(P + r I) w / 2 - sum w.

    Block principal pivoting (Judice & Pires, 1994): all rows taken wrongly change sides, and where
    that has not helped three times in a row only the last of them, which ends in any case.

    Args:
        lock: LOCK, with P (count, count), positive semi-definite, as `products`.
        count: how many rows there are.
        regular: r > 0.
    """
    pushing = lock.pushing
    for i in range(count):
        pushing[i] = 1
    fewest, patience = count + 1, 3
    for _ in range(20 * (count + 1)):
        wrong = _correct(lock, count, regular)
        if wrong == 0:
            break
        if wrong < fewest:
            fewest, patience = wrong, 3
        elif patience > 0:
            patience -= 1
        last = patience == 0 and wrong >= fewest
        for i in range(count - 1, -1, -1):
            if lock.pull[i] < -_ROUNDING:
                pushing[i] = 1 - pushing[i]
                if last:
                    break


@compiled(Count, LOCK.kind, Count, Count, Count)
def _find_implied(lock: Any, known: int, count: int, equalities: int) -> int:
    """Move rows that no motion within the equalities leaves behind the known ones.

    With u_i what the equalities leave of row i, the direction d that minimises

        |d|^2 / 2 + sum s_i^2 / (2 r),      u_i d <= s_i - 1

    lets go of every row that can be let go of, with s_i near zero; of the others, which add up to
    nothing with positive weights, s_i is one. In between a wedge of half an angle a has
    s = r / (2 a^2 + r): sqrt(r / 2) is the half angle below which it counts as closed.
    The multipliers w of the rows solve the problem of `_place_pushes`, and s = r w.

    Args:
        lock: LOCK, with rows of length one, outwards, in `binding`; result.
        known: how many in front are known to be implied, and among the equalities.
        count: how many there are.
        equalities: how many orthonormal rows of equalities `scaled` has.

    Returns:
        how many are known now.
    """
    binding, free, products, places = lock.binding, lock.free, lock.products, lock.places
    n, size = binding.shape[1], count - known
    regular = 2.0 * _NARROW**2
    for i in range(size):
        for j in range(n):
            free[i, j] = binding[known + i, j]
        remove(lock.scaled, equalities, free, i, n)
        remove(lock.scaled, equalities, free, i, n)
        for k in range(i + 1):
            product = 0.0
            for j in range(n):
                product += free[i, j] * free[k, j]
            products[i, k] = products[k, i] = product
    _place_pushes(lock, size, regular)
    found = known
    for i in range(known, count):
        if regular * lock.push[i - known] > _HALF:
            for j in range(n):
                binding[found, j], binding[i, j] = binding[i, j], binding[found, j]
            places[found], places[i] = places[i], places[found]
            found += 1
    return found


@compiled(Count, PROGRAM.kind, LOCK.kind, Count, Count)
def _extend_by_bounds(program: Any, lock: Any, last: int, count: int) -> int:
    """Add those of the `count` bounds that are equalities to `last` rows; return how many then."""
    scales, n = lock.scales, len(lock.scales)
    for i in range(last):
        for j in range(n):
            lock.free[i, j] = lock.kept[i, j] * scales[j]
    size = extend_basis(lock.free[:last], lock.left, lock.scaled, 0, n)
    known, found = 0, -1
    while found != known:
        known = max(found, 0)
        found = _find_implied(lock, known, count, size)
        size = extend_basis(lock.binding[known:found], lock.left, lock.scaled, size, n)
    for i in range(found):
        lock.decided[lock.places[i]] = 1
        for j in range(n):
            lock.free[i, j] = lock.binding[i, j] / scales[j]
    return extend_basis(lock.free[:found], lock.left, lock.kept, last, n)


@compiled(Nothing, PROGRAM.kind, LOCK.kind, Row, Number, Count, Count)
def let_pass(program: Any, lock: Any, x: FloatArray, slack: float, start: int, stop: int) -> None:
    """Move the bounds of rows from `start` to `stop` to where x (n,) is, by `slack` at most.

    Then the solution of the level above is one of this level, and no gap of the tolerance's size
    parts bounds that meet. A bound that has become an equality is none any more.
    """
    solver, size, counts = program.solver, len(lock.decided), program.counts
    for i in range(start, stop):
        # limits of joints and distances may have given way above
        room = np.inf if counts[JOINT] <= i < counts[BOUNDS] else slack
        # of the second row of a gear that has two the first one knows whether it is decided
        if lock.decided[i if i < size else i - size] != 0:
            solver.lower[i], solver.upper[i] = -INFINITE, INFINITE
            continue
        low, high, value = program.stated_lower[i], program.stated_upper[i], 0.0
        for j in range(len(x)):
            value += solver.C[i, j] * x[j]
        solver.upper[i] = high + min(max(value - high, 0.0), room)
        solver.lower[i] = low - min(max(low - value, 0.0), room)


@compiled(Flag, PROGRAM.kind, LOCK.kind)
def _forces_balance(program: Any, lock: Any) -> bool:
    """Whether contact forces meet the balance of the undriven coordinates at every qdd."""
    jacobian, undriven = program.contacts.rows.jacobian, program.undriven
    for i in range(len(undriven)):
        for j in range(len(jacobian)):
            lock.free[i, j] = jacobian[j, undriven[i]]
    forces, count = len(jacobian), len(undriven)
    spanned: int = extend_basis(lock.free[:count], lock.left, lock.kept, 0, forces)
    return spanned == count


@compiled(Count, PROGRAM.kind, LOCK.kind, Row, Flag, Count, Number)
def hold(program: Any, lock: Any, x: FloatArray, limited: bool, unlocked: int, reach: float) -> int:
    """Write the rows that hold what x (n,) of the level above gives its tasks.

    The tasks may ask for more than the robot has freedoms, and the contacts and the balance of the
    undriven coordinates take some of those away. Only what the tasks' rows add to the equalities
    is locked, as orthonormal rows: as many as there are decisions, however they were asked for,
    and none that could contradict another. Tasks are of qdd alone: a balance that forces meet in
    any case is none of their business, unless bounds that also limit forces join in.

    Where bounds kept the tasks from more, most of these bounds cannot be left either without losing
    something of the tasks (Escande, Mansard & Wieber, 2014): rows that add up to nothing with
    positive weights. As inequalities they have no room between them, and pushes without limit.
    They are locked as well, and are no bounds any more.

    Args:
        program: PROGRAM, evaluated.
        lock: LOCK, with `above` written.
        x: (n,).
        limited: whether torque limits may bind; their rows are then those of x.
        unlocked: how many equalities are the robot's own.
        reach: within which a bound counts as reached, and how far bounds may move.

    Returns:
        how many freedoms of qdd, or of x, are left.
    """
    solver, counts, scales = program.solver, program.counts, lock.scales
    top, nv, n = counts[COST], len(program.tasks.diagonal), len(x)
    for j in range(n):
        weight = program.tasks.diagonal[j] if j < nv else solver.diagonal[j]
        scales[j] = 1.0 / sqrt(weight + program.numbers[REGULAR])
    reached = _gather_binding(program, lock, 0 if limited else counts[TORQUE], x, reach)
    own, width = top, n
    if reached == 0 and _forces_balance(program, lock):
        own, width = top + len(program.undriven), nv
    lock.decided[:] = 0
    first = extend_basis(solver.rows[own : top + unlocked], lock.left, lock.kept, 0, width)
    last = extend_basis(lock.above, lock.left, lock.kept, first, width)
    if reached > 0 and last < n:
        last = _extend_by_bounds(program, lock, last, reached)
    counts[HARD] = unlocked + last - first
    for i in range(first, last):
        row, right = top + unlocked + i - first, 0.0
        for j in range(n):
            solver.rows[row, j] = lock.kept[i, j] if j < width else 0.0
            right += solver.rows[row, j] * x[j]
        solver.right[row], solver.softness[row] = right, 0.0
    let_pass(program, lock, x, reach, counts[TORQUE], counts[BOUNDS])
    return width - last
