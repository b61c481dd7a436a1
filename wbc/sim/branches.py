"""The linear system of a guessed branch for every row, and the branch a point lies on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import BoolArray, FloatArray
from wbc.sim.elements import Modes, meeting_speed, modes_at
from wbc.sim.reduced import Reduced


@dataclass(frozen=True, eq=False, slots=True)
class Branches:
    """One linear piece of every row's law.

    Attributes:
        modes: of the elements.
        closed: (l + k,) which limits and contacts push.
        sliding: (k,) which closed contacts slide.
        direction: (k, d) in which the friction of each contact pushes.
        turning: (k,) mu p_n / |p_t - slope u_t| <= 1, how far the direction may turn (d = 2).
        distance: natural residual (r,) of every row at the point the branches were looked up for,
            as a speed; zero exactly at a solution. The line of slope `reduced.slope` through
            (speed, impulse) meets a monotone law in one point, and this is how far away it is; for
            contacts it is Alart and Curnier's map, the normal projected onto the half line, the
            tangents onto the disc of radius mu p_n.
    """

    modes: Modes
    closed: BoolArray
    sliding: BoolArray
    direction: FloatArray
    turning: FloatArray
    distance: FloatArray

    @property
    def worst(self) -> float:
        """Largest distance of a row from its law."""
        return float(np.abs(self.distance).max(initial=0.0))


def branches_at(reduced: Reduced, impulse: FloatArray, speed: FloatArray) -> Branches:
    """Return the branches met by the lines of slope `reduced.slope` through (speed, impulse)."""
    elements, slope, m = reduced.program.elements, reduced.slope, reduced.elements
    point = impulse - slope * speed
    modes = modes_at(elements, point[:m], slope[:m])
    distance = np.empty(len(point))
    distance[:m] = meeting_speed(elements, modes, point[:m], slope[:m]) - speed[:m]
    k, d = reduced.contacts, reduced.tangents
    if len(point) == m:
        none = np.zeros(0, dtype=bool)
        return Branches(modes, none, none, np.zeros((k, d)), np.zeros(k), distance)
    unilateral, normal = reduced.program.unilateral, reduced.normal_rows
    push = point[normal] + slope[normal] * unilateral.target
    closed = push > 0.0
    pressed = np.maximum(push, 0.0)
    distance[normal] = (pressed - impulse[normal]) / slope[normal]
    if k == 0:
        return Branches(modes, closed, closed[:0], np.zeros((k, d)), np.zeros(k), distance)
    tangent = reduced.tangent_rows
    friction = point[tangent].reshape(k, d)
    size = np.sqrt((friction * friction).sum(axis=1))
    bound = unilateral.friction * pressed[reduced.limits :]
    sliding = closed[reduced.limits :] & (size >= bound)
    safe = np.where(size > 0.0, size, 1.0)
    share = bound / safe
    kept = friction * np.where(size > bound, share, 1.0)[:, None]
    distance[tangent] = (kept.ravel() - impulse[tangent]) / slope[tangent]
    return Branches(modes, closed, sliding, friction / safe[:, None], share, distance)


def solve_branches(reduced: Reduced, branches: Branches, anchor: FloatArray) -> FloatArray | None:
    """Return the row impulses (r,) that solve the linear pieces of `branches`.

    Rows that depend on each other (more stuck gears and sticking contacts than the robot has
    freedoms) leave their split open; what is left open stays near `anchor` (r,), by a proximal
    term whose effect on the rest a second solve with the same factors removes. None where the
    pieces contradict each other.
    """
    on_speed, on_impulse, constant = _scalar_rows(reduced, branches)
    spring = 1e-9 * reduced.diagonal * on_speed
    total = np.asfortranarray(on_speed[:, None] * reduced.delassus)
    total.T.ravel()[:: len(total) + 1] += on_impulse + spring
    right = constant - on_speed * reduced.free
    if branches.sliding.any():
        _add_sliding(reduced, branches, total, right)
    factor, pivots, info = lapack.dgetrf(total, overwrite_a=1)
    if info != 0:
        return None
    solution, _ = lapack.dgetrs(factor, pivots, right + spring * anchor)
    correction, _ = lapack.dgetrs(factor, pivots, spring * (solution - anchor))
    return np.asarray(solution + correction)


def _scalar_rows(reduced: Reduced, branches: Branches) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return s, b, c (r,) of the rows s w + b impulse = c, sliding contacts left to add."""
    elements, modes, m = reduced.program.elements, branches.modes, reduced.elements
    on_speed, on_impulse, constant = np.zeros((3, len(reduced.free)))
    moving = modes.sign != 0.0
    on_speed[:m] = np.where(moving, elements.inertia + modes.gain * elements.damping, 1.0)
    on_impulse[:m] = np.where(moving, modes.gain, 0.0)
    constant[:m] = modes.bring - modes.sign * modes.gain * elements.friction
    if len(constant) > m:
        normal = reduced.normal_rows
        on_speed[normal] = branches.closed
        on_impulse[normal] = ~branches.closed
        constant[normal] = branches.closed * reduced.program.unilateral.target
        sticking = branches.closed[reduced.limits :] & ~branches.sliding
        tangent = reduced.tangent_rows
        on_speed[tangent] = np.repeat(sticking, reduced.tangents)
        on_impulse[tangent] = 1.0 - on_speed[tangent]
    return on_speed, on_impulse, constant


def _add_sliding(
    reduced: Reduced, branches: Branches, total: FloatArray, right: FloatArray
) -> None:
    """Add p_t = mu p_n direction, and how the direction turns with the slip, in place."""
    d, first = reduced.tangents, reduced.tangent_rows.start
    normals = reduced.elements + reduced.limits
    for i in np.flatnonzero(branches.sliding):
        rows = slice(first + i * d, first + (i + 1) * d)
        direction = branches.direction[i]
        total[rows, normals + i] -= reduced.program.unilateral.friction[i] * direction
        if d == 2:
            turn = branches.turning[i] * (np.eye(2) - direction[:, None] * direction)
            total[rows, rows] -= turn
            turn *= reduced.slope[rows.start]
            total[rows] += turn @ reduced.delassus[rows]
            right[rows] -= turn @ reduced.free[rows]
