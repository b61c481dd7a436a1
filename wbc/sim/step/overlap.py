"""Taking back an overlap: the robot is moved out, its velocity stays.

What a barrier is overrun by (drift of a part of a step, or a ground whose gap jumps) is a matter of
place. Were it taken back by a speed, the robot would leave with that speed.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.linalg import lapack

from wbc.arrays import BoolArray, FloatArray
from wbc.compiled import Dense, Nothing, OutRow, OutVector, Vector, compiled
from wbc.dynamics import Workspace
from wbc.errors import SimulationError
from wbc.sim.ground.barriers import TOUCH, Barriers, ClosedRows
from wbc.sim.laws.drivetrain import Drivetrain
from wbc.sim.solve.linear import factor, solve_factored

DRIFT = 1e-8
"""Overlap, or gap of a barrier that is pressed, [m, rad] from which on it is taken back."""
CORRECTIONS = 10
"""Most shifts along the rows of the middle that take an overlap back. Gaps are not linear in the
shift: after steps of 20 ms one shift left up to 0.1 mm. Of 614 corrections in 60 soft scenes of
`benchmarks.passivity` 519 took one shift, 81 two, 11 three and 3 four."""

_TRIES = 100
_NEAR = 0.05  # [m, rad] a correction at most, and how near a barrier must be to bound it
_STIFF = 1e6


@compiled(Nothing, Dense, Vector, Vector, OutVector, counted=False)
def project(
    delassus: FloatArray, missing: FloatArray, lowest: FloatArray, push: FloatArray
) -> None:
    """Sweep towards lowest <= push, delassus @ push >= missing, complementary (Gauss-Seidel)."""
    most = 0.0
    for i in range(len(missing)):
        most = max(most, abs(missing[i]))
    for _ in range(100):
        worst = 0.0
        for i in range(len(missing)):
            if delassus[i, i] <= 0.0:
                continue
            rest = missing[i]
            for j in range(len(missing)):
                rest -= delassus[i, j] * push[j]
            aim = max(push[i] + rest / delassus[i, i], lowest[i])
            worst = max(worst, abs(aim - push[i]) * delassus[i, i])
            push[i] = aim
        if worst <= 1e-6 * most:
            return


@compiled(Nothing, Dense, Vector, Vector, OutRow)
def least(delassus: FloatArray, missing: FloatArray, lowest: FloatArray, push: FloatArray) -> None:
    """Write the pushes (b,) with lowest <= push, delassus @ push >= missing, complementary.

    Where none is bounded, one linear solve; a hair of compliance chooses among equal ones.
    """
    size = len(missing)
    total, pivots = np.empty((size, size)), np.empty(size, dtype=np.int64)
    bounded = False
    for i in range(size):
        bounded = bounded or lowest[i] == 0.0
        push[i] = missing[i]
        for j in range(size):
            total[i, j] = delassus[i, j]
        total[i, i] *= 1.0 + 1e-9
    if not bounded and factor(total, pivots):
        solve_factored(total, pivots, push)
        return
    push[:] = 0.0
    project(delassus, missing, lowest, push)


def aim_of(gap: FloatArray, furthest: float, pressed: BoolArray) -> FloatArray:
    """Return the gaps (l + c,) that are aimed at from gaps (l + c,), at most `furthest` away."""
    nearer = np.where(pressed, np.maximum(-gap, -furthest), -gap)
    return np.asarray(gap + np.minimum(nearer, furthest))


def farthest_off(missing: FloatArray, pressed: BoolArray) -> float:
    """Return by how much [m, rad] gaps that lack `missing` (l + c,) miss their aim at most."""
    return float(np.where(pressed, np.abs(missing), missing).max(initial=0.0))


def shift_out(
    metric: FloatArray, held: ClosedRows, missing: FloatArray, pressed: BoolArray
) -> FloatArray:
    """Return the least shift (nv,) of the configuration that takes overlaps back.

    Args:
        metric: (nv, nv), upper half, in which it is least.
        held: rows of the barriers that are closed.
        missing: (l + c,) [m, rad] by which their gaps are to open, below zero where they may close.
        pressed: (l + c,) barriers that carry an impulse: their gaps are taken back from either
            side.
    """
    rows = np.concatenate((held.unilateral.limits, held.unilateral.normals))
    _, response, info = lapack.dposv(metric, rows.T)
    if info != 0:
        return np.zeros(len(metric))
    push = np.zeros(len(rows))
    lowest = np.where(pressed, -np.inf, 0.0)
    least(np.ascontiguousarray(rows @ response), missing, lowest, push)
    return np.asarray(response @ push)


def inertia_with_rotors(drive: Drivetrain, inertia: FloatArray) -> FloatArray:
    """Return H_l (nv, nv) with the rotors of rigid gears: what is light moves first."""
    rigid = ~drive.loose
    turning = drive.rows[rigid]
    return np.asarray(inertia + turning.T @ (drive.inertia[rigid, None] * turning))


def lifted_out(space: Workspace, barriers: Barriers, position: FloatArray) -> FloatArray:
    """Return q (nq,) moved out of the ground (as it lies at time zero) and to the joint limits.

    Driven joints keep their angles where a free base can do it.

    Args:
        space: workspace of the robot.
        barriers: its limits and contacts.
        position: q (nq,).

    Raises:
        SimulationError: a point that no motion brings out.
    """
    robot = space.robot
    q = barriers.within_limits(position)
    stiff = np.zeros(space.model.nv)
    gap = worst = np.zeros(0)
    for _ in range(_TRIES):
        pin.crba(space.model, space.data, q, pin.Convention.WORLD)
        clearance = barriers.clearance(q, 0.0)
        gap = clearance.gap
        if gap.min(initial=0.0) >= -0.5 * TOUCH:
            return q
        worst = gap if not worst.size else worst
        near = barriers.rows(gap < _NEAR, clearance, np.zeros(barriers.size))
        stiff[robot.actuated] = _STIFF * space.data.M.diagonal().max()
        metric = space.data.M + np.diag(stiff)
        held = np.zeros(len(near.which) + len(near.limits), dtype=bool)
        missing = np.minimum(-gap[gap < _NEAR], _NEAR)
        q = pin.integrate(space.model, q, shift_out(metric, near, missing, held))
    place = int(np.argmin(worst))
    raise SimulationError(
        f"'{robot.name}' cannot be lifted out of the ground: {barriers.names[place]} starts "
        f"{-worst[place]:.3g} m (rad) inside, and no motion of its free joints brings it out."
    )
