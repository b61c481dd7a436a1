"""The step as a convex program with second-order friction cones, by quadratic programs.

Each monotone law is a convex, piecewise quadratic cost of its speed; the pieces become slack
speeds with a linear and a quadratic cost that grow from one piece to the next, so that the minimum
fills them in order. A friction cone, u_n - target >= mu |u_t| and its dual |p_t| <= mu p_n, stands
as u_n - mu d'u_t >= target for some directions d, of which every round adds the one in which the
point slides (cutting planes). Coulomb's law is reached from this associated law, which lifts a
point off while it slides, by De Saxce's correction: the normal target is lowered by mu |u_t| of
the round before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from proxsuite import proxqp

from wbc.arrays import FloatArray
from wbc.sim.solve.law_cost import CostPiece, cost_pieces
from wbc.sim.solve.reduced import Reduced

_ROUNDS = 120
_UNSOLVED = 3
_FIRST_DIRECTIONS = 8
_INFINITE = 1e20


@dataclass(frozen=True, eq=False, slots=True)
class _Costs:
    """What stays the same from round to round: unknowns v, slack speeds, spring speeds.

    Attributes:
        quadratic: (z, z).
        linear: (z,).
        equal: (m, z), right side `right` (m,).
        right: (m,).
        pieces: whose slack speeds follow v.
    """

    quadratic: FloatArray
    linear: FloatArray
    equal: FloatArray
    right: FloatArray
    pieces: list[CostPiece]


def qp_candidates(reduced: Reduced) -> Iterator[tuple[FloatArray, bool]]:
    """Yield row impulses (r,) ever nearer to a solution; none where a gear is self-locking.

    With each comes whether it solves its round's program, which may have no solution.

    The first one solves the step as it stands if no contact slides; the later ones approach
    Coulomb's law. They are starts for Newton's iteration, which certifies.
    """
    pieces = cost_pieces(reduced.program.elements)
    if pieces is None:
        return
    costs, d = _costs(reduced, pieces), reduced.tangents
    directions = [_first_directions(d)] * reduced.contacts
    slip, unsolved = np.zeros(reduced.contacts), 0
    for _ in range(_ROUNDS if d else 1):
        impulse, solved = _solve(reduced, costs, directions, slip)
        unsolved += not solved
        if unsolved > _UNSOLVED or not np.isfinite(impulse).all():
            return
        yield impulse, solved
        sliding = reduced.speeds(impulse)[reduced.tangent_rows].reshape(reduced.contacts, d)
        slip = np.linalg.norm(sliding, axis=1)
        if d == 2:
            directions = [
                np.vstack((known, along / speed)) if speed > 0.0 else known
                for known, along, speed in zip(directions, sliding, slip, strict=True)
            ]


def _first_directions(d: int) -> FloatArray:
    """Return unit vectors (c, d): both ways along one tangent, all round in a plane."""
    if d == 2:
        angle = 2.0 * np.pi * np.arange(_FIRST_DIRECTIONS) / _FIRST_DIRECTIONS
        return np.column_stack((np.cos(angle), np.sin(angle)))
    return np.array([[1.0], [-1.0]]) if d == 1 else np.zeros((1, 0))


def _costs(reduced: Reduced, pieces: list[CostPiece]) -> _Costs:
    program = reduced.program
    n, m = len(program.free_velocity), reduced.elements
    first_spring = n + len(pieces)
    size = first_spring + m
    quadratic, linear = np.zeros((size, size)), np.zeros(size)
    quadratic[:n, :n] = program.inertia
    linear[:n] = -program.inertia @ program.free_velocity
    equal = np.zeros((m, size))
    equal[:, :n] = program.elements.rows
    for j, piece in enumerate(pieces, start=n):
        quadratic[j, j], linear[j] = piece.curvature, piece.level
        equal[piece.element, j] = -piece.sign
    # The speed of a spring in series, w - W v; where there is none it stays zero.
    soft, springs = np.isfinite(program.elements.stiffness), np.arange(first_spring, size)
    equal[soft, springs[soft]] = 1.0
    quadratic[springs, springs] = np.where(soft, program.elements.stiffness, 1.0)
    linear[springs] = program.elements.preload
    return _Costs(quadratic, linear, equal, np.zeros(m), pieces)


def _solve(
    reduced: Reduced, costs: _Costs, directions: list[FloatArray], slip: FloatArray
) -> tuple[FloatArray, bool]:
    """Return the row impulses of one round, and whether proxsuite calls it solved."""
    u, n = reduced.program.unilateral, len(reduced.program.free_velocity)
    nl, d, count = reduced.limits, reduced.tangents, len(costs.pieces)
    rows, floors = [u.limits], [u.target[:nl]]
    ground = np.zeros(len(directions) * (1 + d)) if u.ground is None else u.ground
    for i, along in enumerate(directions):
        tangents = u.tangents[i * d : (i + 1) * d]
        rows.append(u.normals[i] - u.friction[i] * (along @ tangents))
        first = len(directions) + i * d
        carried = ground[i] - u.friction[i] * (along @ ground[first : first + d])
        floors.append(u.target[nl + i] - u.friction[i] * slip[i] + carried)
    push = np.vstack(rows)
    inequality = np.zeros((count + len(push), len(costs.linear)))
    inequality[np.arange(count), n + np.arange(count)] = 1.0
    inequality[count:, :n] = push
    lower = np.concatenate((np.zeros(count), *floors))
    upper = np.full(len(lower), _INFINITE)
    upper[:count] = [min(piece.length, _INFINITE) for piece in costs.pieces]
    dual, solved = _run(costs, inequality, lower, upper)
    m, k = reduced.elements, reduced.contacts
    impulse = np.zeros(len(reduced.free))
    impulse[:m] = -dual[:m]
    pressed = -dual[m + count :]
    impulse[m : m + nl] = pressed[:nl]
    first = nl
    for i, along in enumerate(directions):
        share = pressed[first : first + len(along)]
        first += len(along)
        impulse[m + nl + i] = share.sum()
        tangent = m + nl + k + i * d
        impulse[tangent : tangent + d] = -u.friction[i] * (share @ along)
    return impulse, solved


def _run(
    costs: _Costs, inequality: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, bool]:
    """Return the multipliers of equalities and inequalities, and whether they are a solution."""
    solver = proxqp.dense.QP(len(costs.linear), len(costs.equal), len(inequality))
    solver.settings.eps_abs = 1e-11
    solver.settings.eps_rel = 0.0
    # A program that has no solution costs all of them: a tenth of a second.
    solver.settings.max_iter = 400
    solver.settings.max_iter_in = 100
    solver.init(costs.quadratic, costs.linear, costs.equal, costs.right, inequality, lower, upper)
    solver.solve()
    solved = solver.results.info.status == proxqp.QPSolverOutput.PROXQP_SOLVED
    return np.concatenate((solver.results.y, solver.results.z)), solved
