"""One step as a program, and its solution: every row on its law at once.

Over a step a dissipative row (a gear, dry friction, or both in one row) with speed w after the step
carries an impulse T (on the links, along the row). With s = sgn(w) and the gear's share
T_g = T + s f + B w of the impulse:

    w > 0:  M w + k T_g = up        k = 1/eta_f where s T_g > 0 (motor drives), eta_b otherwise
    w < 0:  M w + k T_g = down
    w = 0:  T anywhere between the two branches

M is the reflected rotor inertia (plus the step's viscous share), up and down the impulse that the
rotor brings along: motor impulse plus M w_before, less or plus the rotor's Coulomb impulse. For
eta_f eta_b <= 1 the graph T(w) is non-increasing: a step is a convex program. Friction of a joint
alone is the same law with M = up = down = 0 and both efficiencies one.

A spring in series, T = p + s (w - W v), leaves a law of the same kind between T and u = W v. With
s = 0 it is T = p: it is written so that a spring that hardly changes its impulse (a short step, a
flank that is only just reached) is as regular as a stiff one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.mechanics.linear import factor_inertia
from wbc.mechanics.newton import UNSOLVED, WAYS, distance, look_at, solve_system, velocity_after
from wbc.mechanics.rows import RowSystem, system_of
from wbc.sim.step.self_locking import falling_rows, solve_in_ranges, undecided_rows

TOLERANCE = 1e-10
"""Accepted distance of a row from its law, as a share of the largest speed or target plus 1.

A target below zero does not count: a row reaches it only at speeds that count already, and a
barrier that is kept in a short part has one that no speed comes near.
"""

NOT_POSITIVE = (
    "the inertia matrix of the links is not positive definite: some body without mass moves "
    "freely. Give every moving body a mass."
)


@dataclass(frozen=True, eq=False, slots=True)
class Elements:
    """Rows of a step with a dissipative law; every array has one entry per row.

    Attributes:
        rows: W (m, n); w = W v where there is no spring.
        up: impulse the rotor brings along when it ends up turning forward [N m s].
        down: the same when it ends up turning backward; up <= down in a step with time.
        inertia: M >= 0 [kg m^2].
        forward: eta_f.
        backward: eta_b; zero or less is self-locking.
        friction: f >= 0, dry friction impulse at the output [N m s].
        damping: B >= 0, viscous impulse per speed at the output [kg m^2].
        stiffness: s >= 0, impulse per speed of a spring in series [kg m^2]; infinite for none.
        preload: p, what that spring passes without relative speed [N m s].
    """

    rows: FloatArray
    up: FloatArray
    down: FloatArray
    inertia: FloatArray
    forward: FloatArray
    backward: FloatArray
    friction: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    preload: FloatArray

    @classmethod
    def of(cls, rows: FloatArray, laws: FloatArray) -> Elements:
        """Return the elements with `RowSystem.laws` (m, 9)."""
        columns = list(laws.T)
        columns[3] = 1.0 / columns[3]
        return cls(rows, *columns)

    @property
    def size(self) -> int:
        """m, the number of rows."""
        return len(self.up)

    @property
    def laws(self) -> FloatArray:
        """(m, 9), see `RowSystem.laws`."""
        columns = [getattr(self, field.name) for field in fields(self)][1:]
        columns[3] = 1.0 / columns[3]
        return np.column_stack(columns)


@dataclass(frozen=True, eq=False, slots=True)
class Unilateral:
    """Rows that push but never pull: joint limits, then contact points with friction.

    A limit or contact normal obeys 0 <= p_n, u_n >= target, p_n (u_n - target) = 0. A contact's
    tangential impulse obeys Coulomb's law exactly: |p_t| <= mu p_n, and where the point slides,
    p_t = -mu p_n u_t / |u_t|.

    Attributes:
        limits: rows of joint limits (l, n).
        normals: rows of contact normals (k, n).
        tangents: rows of contact tangents (k d, n), d per contact (0, 1 planar, or 2).
        friction: mu (k,).
        target: lowest normal speeds (l + k,) [rad/s, m/s], limits first.
        ground: speed (k + k d,) [m/s] of the ground along normals and tangents, from which u_n and
            u_t are counted; None where no ground moves.
    """

    limits: FloatArray
    normals: FloatArray
    tangents: FloatArray
    friction: FloatArray
    target: FloatArray
    ground: FloatArray | None = None

    @property
    def tangent_size(self) -> int:
        """d, tangential directions per contact."""
        return len(self.tangents) // len(self.normals) if len(self.normals) else 0


@dataclass(frozen=True, eq=False, slots=True)
class StepProgram:
    """Find v with H (v - v_free) = G' impulse, every row on its law.

    G stacks the rows in the order elements, limits, normals, tangents.

    Attributes:
        inertia: H_l (n, n), symmetric positive definite, without reflected rotor inertia.
        free_velocity: v_free (n,), where the links would go without the rows.
        elements: the dissipative rows.
        unilateral: limits and contacts.
    """

    inertia: FloatArray
    free_velocity: FloatArray
    elements: Elements
    unilateral: Unilateral

    def rows(self) -> FloatArray:
        """Return G (r, n)."""
        u = self.unilateral
        return np.concatenate((self.elements.rows, u.limits, u.normals, u.tangents))

    def system(self) -> tuple[RowSystem, FloatArray]:
        """Return what the step is to its rows, and L (n, n) with L' L = H_l.

        Raises:
            SimulationError: the link inertia is not positive definite, or has no numbers.
        """
        lower, u = np.empty(self.inertia.shape), self.unilateral
        if not factor_inertia(np.ascontiguousarray(self.inertia), lower):
            if not np.isfinite(self.inertia).all():
                raise blown_up(self.inertia, self.free_velocity)
            raise SimulationError(NOT_POSITIVE)
        free, laws, target, friction = (
            np.ascontiguousarray(array)
            for array in (self.free_velocity, self.elements.laws, u.target, u.friction)
        )
        rows = np.ascontiguousarray(self.rows())
        system = system_of(rows, lower, free, laws, target, friction, u.tangent_size)
        if u.ground is not None:
            system.free[self.elements.size + len(u.limits) :] -= u.ground
        return system, lower


@dataclass(frozen=True, slots=True)
class Residuals:
    """How far a solution is from satisfying the step program, each at its worst row.

    Attributes:
        dynamics: |H (v - v_free) - G' impulse| [N m s].
        law: distance of (w, T) of an element from its law, as a speed [rad/s].
        complementarity: of limits and contact normals, as a speed [m/s].
        cone: |p_t| - mu p_n where positive [N s].
        friction: distance from Coulomb's law of a closed contact, as a speed [m/s].
    """

    dynamics: float = 0.0
    law: float = 0.0
    complementarity: float = 0.0
    cone: float = 0.0
    friction: float = 0.0

    @property
    def worst_speed(self) -> float:
        """Largest of the residuals that are speeds."""
        return max(self.law, self.complementarity, self.friction)


def worst(*several: Residuals) -> Residuals:
    """Return the largest of each residual."""
    return Residuals(*(max(getattr(r, f.name) for r in several) for f in fields(Residuals)))


@dataclass(frozen=True, eq=False)
class StepSolution:
    """Velocity and impulses at the end of a step.

    Attributes:
        velocity: v (n,).
        impulse: (r,) of every row, in the order of `StepProgram.rows`.
        speed: (r,) of every row, G v, counted from the ground's.
        iterations: linear systems solved.
        method: "newton", "convex" or "proximal", whichever found it, "passive" where friction gave
            way; "ranges" where self-locking gears were held to a range of their laws.
        program: that it solves.
        system: the same as the rows see it.
    """

    velocity: FloatArray
    impulse: FloatArray
    speed: FloatArray
    iterations: int
    method: str
    program: StepProgram
    system: RowSystem

    @property
    def normal_rows(self) -> slice:
        """Limits and contact normals."""
        first = self.program.elements.size
        return slice(first, first + len(self.program.unilateral.target))

    @property
    def element_impulse(self) -> FloatArray:
        """T (m,) [N m s] of the dissipative rows."""
        return self.impulse[: self.normal_rows.start]

    @property
    def normal_impulse(self) -> FloatArray:
        """p_n (l + k,) of limits and contacts."""
        return self.impulse[self.normal_rows]

    @property
    def tangent_impulse(self) -> FloatArray:
        """p_t (k, d) of the contacts [N s]."""
        contacts, d = len(self.program.unilateral.normals), self.system.tangents
        return self.impulse[self.normal_rows.stop :].reshape(contacts, d)

    @cached_property
    def residuals(self) -> Residuals:
        """How exact this solution is, computed from the program anew."""
        program, system = self.program, self.system
        dynamics = program.inertia @ (self.velocity - program.free_velocity)
        dynamics -= program.rows().T @ self.impulse
        pieces, sliding = np.empty((len(self.impulse), 4)), np.empty((len(system.frictions), 3))
        look_at(system, self.impulse, np.empty(len(self.impulse)), pieces, sliding)
        rows, normal = np.abs(pieces[:, 3]), self.normal_rows
        pushed = self.normal_impulse[len(program.unilateral.limits) :] * system.frictions
        outside = np.linalg.norm(self.tangent_impulse, axis=1) - pushed
        return Residuals(
            dynamics=float(np.abs(dynamics).max(initial=0.0)),
            law=float(rows[: normal.start].max(initial=0.0)),
            complementarity=float(rows[normal].max(initial=0.0)),
            cone=float(outside.max(initial=0.0)) if system.tangents else 0.0,
            friction=float(rows[normal.stop :].max(initial=0.0)),
        )


def solve_program(
    program: StepProgram, guess: FloatArray | None = None, names: Sequence[str] = ()
) -> StepSolution:
    """Return the velocity and row impulses that satisfy every law of a step at once.

    Args:
        program: the step.
        guess: row impulses (r,) to start from, those of the previous step; their branches are
            usually the right ones already, and a self-locking gear stays on its own.
        names: of the dissipative rows, for messages.

    Raises:
        SimulationError: no solution was found, or a self-locking gear leaves several.
    """
    system, lower = program.system()
    start = np.zeros(len(system.free)) if guess is None else np.ascontiguousarray(guess)
    impulse, used, method = solve_rows(system, start, names)
    velocity = np.empty(len(program.free_velocity))
    free = np.ascontiguousarray(program.free_velocity)
    velocity_after(system, lower, free, impulse, velocity)
    speed = system.free + system.delassus @ impulse
    return StepSolution(velocity, impulse, speed, used, method, program, system)


def tolerance_of(system: RowSystem) -> float:
    """Return the largest distance of a row from its law in a solution, as a speed."""
    fastest = max(np.abs(system.free).max(initial=0.0), system.targets.max(initial=0.0))
    return TOLERANCE * (1.0 + float(fastest))


def solve_rows(
    system: RowSystem, start: FloatArray, names: Sequence[str]
) -> tuple[FloatArray, int, str]:
    """Return row impulses (r,), the linear systems that they took, and the method.

    Args:
        system: of the rows.
        start: (r,) impulses of the step before, or zeros.
        names: of the dissipative rows, for messages; may be shorter.

    Raises:
        SimulationError: no solution was found, or a self-locking gear leaves several.
    """
    tolerance = tolerance_of(system)
    if falling_rows(system.laws).any():
        rows = undecided_rows(system)
        if rows.size:
            return *solve_in_ranges(system, rows, start, tolerance, names), "ranges"
    impulse = np.empty(len(start))
    used, way = solve_system(system, start, tolerance, 1.0, impulse)
    if way == UNSOLVED:
        raise unsolved(system, impulse, tolerance)
    return impulse, used, WAYS[way]


def unsolved(system: RowSystem, impulse: FloatArray, tolerance: float) -> SimulationError:
    """Return the error for a step of which `impulse` (r,) is the nearest to a solution."""
    if not (np.isfinite(system.delassus).all() and np.isfinite(system.free).all()):
        return SimulationError(
            "the step has no numbers: the state has blown up. Look at the events of the steps "
            "before, and at the torques."
        )
    return SimulationError(
        f"a step with {len(system.laws)} gears and joints and {len(system.frictions)} contacts "
        f"has no solution within {tolerance:.1e} (nearest: {distance(system, impulse):.1e}). "
        "Usual causes: a contact target that the joints cannot reach (a limit and the ground in "
        "conflict), or a self-locking gear whose falling branch leaves no solution; shorten the "
        "step or change the state."
    )


def blown_up(inertia: FloatArray, velocity: FloatArray) -> SimulationError:
    """Return the error for a step whose inertia was good once and is no longer.

    Args:
        inertia: H_l (n, n).
        velocity: v (n,) before the step.
    """
    with np.errstate(all="ignore"):
        energy = 0.5 * float(velocity @ inertia @ velocity)
        fastest = float(np.abs(velocity).max(initial=0.0))
    numbers = "the step has no numbers: " if np.isnan(velocity).any() else ""
    return SimulationError(
        f"{numbers}the state has blown up: {energy:.3g} J of kinetic energy, fastest coordinate "
        f"{fastest:.3g} rad/s (m/s). Look at the events of the steps before, and at the torques."
    )
