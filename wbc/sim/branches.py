"""The linear system of a guessed branch for every row, and the branch a point lies on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import BoolArray, FloatArray
from wbc.sim.elements import Modes, modes_at
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
    """

    modes: Modes
    closed: BoolArray
    sliding: BoolArray
    direction: FloatArray
    turning: FloatArray

    def key(self) -> bytes:
        """Return what tells one set of linear pieces from another."""
        d = self.direction
        signs = d if d.shape[1] == 1 else np.zeros(0)
        parts = (self.modes.sign, self.modes.gain, self.closed, self.sliding, signs)
        return b"".join(part.tobytes() for part in parts)


def branches_at(reduced: Reduced, impulse: FloatArray, speed: FloatArray) -> Branches:
    """Return the branches met by the lines impulse - slope speed through a point."""
    program, m = reduced.program, reduced.elements
    point = impulse - reduced.slope * speed
    modes = modes_at(program.elements, point[:m], reduced.slope[:m])
    normal = reduced.normal_rows
    push = point[normal] + reduced.slope[normal] * program.unilateral.target
    closed = push > 0.0
    k, d = reduced.contacts, reduced.tangents
    friction = point[reduced.tangent_rows].reshape(k, d)
    size = np.sqrt((friction * friction).sum(axis=1))
    bound = program.unilateral.friction * np.maximum(push[reduced.limits :], 0.0)
    sliding = closed[reduced.limits :] & (size >= bound)
    safe = np.where(size > 0.0, size, 1.0)
    return Branches(modes, closed, sliding, friction / safe[:, None], bound / safe)


def solve_branches(reduced: Reduced, branches: Branches, anchor: FloatArray) -> FloatArray | None:
    """Return the row impulses (r,) that solve the linear pieces of `branches`.

    Rows that depend on each other (more stuck gears and sticking contacts than the robot has
    freedoms) leave their split open; what is left open stays near `anchor` (r,), by a proximal
    term whose effect on the rest a second solve with the same factors removes. None where the
    pieces contradict each other.
    """
    matrix, constant = _system(reduced, branches)
    on_speed, offset = matrix
    total = on_speed @ reduced.delassus
    total += offset
    spring = np.abs(on_speed.diagonal()) * reduced.diagonal * 1e-9
    total.ravel()[:: len(total) + 1] += spring
    right = constant - on_speed @ reduced.free
    factor, pivots, info = lapack.dgetrf(total, overwrite_a=1)
    if info != 0:
        return None
    solution, _ = lapack.dgetrs(factor, pivots, right + spring * anchor)
    correction, _ = lapack.dgetrs(factor, pivots, spring * (solution - anchor))
    return np.asarray(solution + correction)


def _system(
    reduced: Reduced, branches: Branches
) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Return (S, B) and c of S w + B impulse = c."""
    elements, u = reduced.program.elements, reduced.program.unilateral
    m, limits, k, d = reduced.elements, reduced.limits, reduced.contacts, reduced.tangents
    size = len(reduced.free)
    on_speed, on_impulse = np.zeros(size), np.zeros(size)
    constant = np.zeros(size)
    modes = branches.modes
    moving = modes.sign * modes.sign
    on_speed[:m] = 1.0 - moving + moving * (elements.inertia + modes.gain * elements.damping)
    on_impulse[:m] = moving * modes.gain
    constant[:m] = modes.bring - modes.sign * modes.gain * elements.friction
    normal = reduced.normal_rows
    on_speed[normal] = branches.closed
    on_impulse[normal] = ~branches.closed
    constant[normal] = branches.closed * u.target
    sticking = branches.closed[limits:] & ~branches.sliding
    tangent = reduced.tangent_rows
    on_speed[tangent] = np.repeat(sticking, d)
    on_impulse[tangent] = 1.0 - on_speed[tangent]
    speed_matrix, impulse_matrix = np.diag(on_speed), np.diag(on_impulse)
    for i in np.flatnonzero(branches.sliding):
        rows = slice(m + limits + k + i * d, m + limits + k + (i + 1) * d)
        direction = branches.direction[i]
        impulse_matrix[rows, m + limits + i] = -u.friction[i] * direction
        if d == 2:
            turn = branches.turning[i] * (np.eye(2) - np.outer(direction, direction))
            impulse_matrix[rows, rows] -= turn
            speed_matrix[rows, rows] += reduced.slope[rows.start] * turn
    return (speed_matrix, impulse_matrix), constant
