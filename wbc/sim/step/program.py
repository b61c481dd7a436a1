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

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.mechanics.linear import factor_inertia
from wbc.mechanics.newton import (
    SEVERAL,
    UNSOLVED,
    WAYS,
    distance,
    look_at,
    tolerance_of,
    velocity_after,
)
from wbc.mechanics.rows import RowSystem, system_of
from wbc.sim.step.part_rows import PartRows
from wbc.sim.step.self_locking import several, solve_rows

NOT_POSITIVE = (
    "the inertia matrix of the links is not positive definite: some body without mass moves "
    "freely. Give every moving body a mass."
)


@dataclass(frozen=True, eq=False, slots=True)
class StepProgram:
    """Find v with H (v - v_free) = G' impulse, every row of G on its law.

    The rows are elements with a dissipative law, joint limits, contact normals and contact
    tangents. Limits and normals push but never pull: 0 <= p_n, u_n >= target,
    p_n (u_n - target) = 0. A contact's tangential impulse obeys Coulomb's law exactly:
    |p_t| <= mu p_n, and where the point slides, p_t = -mu p_n u_t / |u_t|.

    Attributes:
        inertia: H_l (n, n), symmetric positive definite, without reflected rotor inertia.
        free_velocity: v_free (n,), where the links would go without the rows.
        rows: G (r, n).
        laws: (m, 9) of the elements, see `RowSystem`.
        targets: lowest speeds (l + k,) [rad/s, m/s] of limits and normals.
        frictions: mu (k,).
        tangents: d, tangential directions per contact (0, 1 planar, or 2).
    """

    inertia: FloatArray
    free_velocity: FloatArray
    rows: FloatArray
    laws: FloatArray
    targets: FloatArray
    frictions: FloatArray
    tangents: int

    @classmethod
    def of(cls, rows: PartRows, system: RowSystem, inertia: FloatArray) -> StepProgram:
        """Return the program of a part or an impact."""
        given = rows.matrix, system.laws, rows.targets, rows.frictions
        return cls(inertia, rows.free, *given, system.tangents)

    def system(self) -> tuple[RowSystem, FloatArray]:
        """Return what the step is to its rows, and L (n, n) with L' L = H_l.

        Raises:
            SimulationError: the link inertia is not positive definite, or has no numbers.
        """
        lower = np.empty(self.inertia.shape)
        if not factor_inertia(np.ascontiguousarray(self.inertia), lower):
            if not np.isfinite(self.inertia).all():
                raise blown_up(self.inertia, self.free_velocity)
            raise SimulationError(NOT_POSITIVE)
        rows, free, laws, targets, frictions = map(
            np.ascontiguousarray,
            (self.rows, self.free_velocity, self.laws, self.targets, self.frictions),
        )
        return system_of(rows, lower, free, laws, targets, frictions, self.tangents), lower


@dataclass(frozen=True, eq=False)
class StepSolution:
    """Velocity and impulses at the end of a step.

    Attributes:
        program: that it solves.
        system: the same as the rows see it.
        velocity: v (n,).
        impulse: (r,) of every row.
        iterations: linear systems solved.
        method: "newton", "convex" or "proximal", whichever found it, "passive" where friction gave
            way; "ranges" where self-locking gears were held to a range of their laws.
    """

    program: StepProgram
    system: RowSystem
    velocity: FloatArray
    impulse: FloatArray
    iterations: int
    method: str

    @property
    def speed(self) -> FloatArray:
        """(r,) of every row, G v."""
        return np.asarray(self.system.free + self.system.delassus @ self.impulse)

    @cached_property
    def residuals(self) -> FloatArray:
        """How far (r,) each row is from its law, as a speed."""
        size = len(self.impulse)
        pieces, sliding = np.empty((size, 4)), np.empty((len(self.system.frictions), 3))
        look_at(self.system, self.impulse, np.empty(size), pieces, sliding)
        return np.abs(pieces[:, 3])


def solve_program(program: StepProgram, guess: FloatArray | None = None) -> StepSolution:
    """Return the velocity and row impulses that satisfy every law of a step at once.

    Args:
        program: the step.
        guess: row impulses (r,) to start from, those of the previous step; their branches are
            usually the right ones already, and a self-locking gear stays on its own.

    Raises:
        SimulationError: no solution was found, or a self-locking gear leaves several.
    """
    system, lower = program.system()
    start = np.zeros(len(system.free)) if guess is None else np.ascontiguousarray(guess)
    impulse, velocity = np.empty(len(start)), np.empty(len(program.free_velocity))
    used, way = solve_rows(system, start, tolerance_of(system), 1.0, impulse)
    if way >= UNSOLVED:
        raise several(system, start, ()) if way == SEVERAL else unsolved(system, impulse)
    free = np.ascontiguousarray(program.free_velocity)
    velocity_after(system, lower, free, impulse, velocity)
    return StepSolution(program, system, velocity, impulse, used, WAYS[way])


def unsolved(system: RowSystem, impulse: FloatArray) -> SimulationError:
    """Return the error for a step of which `impulse` (r,) is the nearest to a solution."""
    if not (np.isfinite(system.delassus).all() and np.isfinite(system.free).all()):
        return SimulationError(
            "the step has no numbers: the state has blown up. Look at the events of the steps "
            "before, and at the torques."
        )
    return SimulationError(
        f"a step with {len(system.laws)} gears and joints and {len(system.frictions)} contacts "
        f"has no solution within {tolerance_of(system):.1e} (nearest: "
        f"{distance(system, impulse):.1e}). Usual causes: a contact target that the joints cannot "
        "reach (a limit and the ground in conflict), or a self-locking gear whose falling branch "
        "leaves no solution; shorten the step or change the state."
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
