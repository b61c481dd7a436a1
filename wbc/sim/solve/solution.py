"""The solution of a step, which knows how exact it is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray
from wbc.sim.solve.reduced import Reduced
from wbc.sim.solve.residuals import Residuals


@dataclass(frozen=True, eq=False)
class StepSolution:
    """Velocity and impulses at the end of a step.

    Attributes:
        velocity: v (n,).
        impulse: (r,) of every row, in the order of `StepProgram.rows`.
        speed: (r,) of every row, G v.
        iterations: linear systems solved.
        method: "newton", "proximal", "sweeps" or "qp", whichever found it; "ranges" where
            self-locking gears were held to every range of their laws.
        reduced: the program, as the solvers saw it.
    """

    velocity: FloatArray
    impulse: FloatArray
    speed: FloatArray
    iterations: int
    method: str
    reduced: Reduced

    @property
    def element_impulse(self) -> FloatArray:
        """T (m,) [N m s] of the dissipative rows."""
        return self.impulse[: self.reduced.elements]

    @property
    def element_speed(self) -> FloatArray:
        """w (m,) of the dissipative rows after the step, beyond the springs in series."""
        m = self.reduced.elements
        own = self.reduced.program.elements
        return own.own_speeds(self.impulse[:m], self.speed[:m], self.reduced.slope[:m])

    @property
    def normal_impulse(self) -> FloatArray:
        """p_n (l + k,) of limits and contacts."""
        return self.impulse[self.reduced.normal_rows]

    @property
    def tangent_impulse(self) -> FloatArray:
        """p_t (k, d) of the contacts [N s]."""
        r = self.reduced
        return self.impulse[r.tangent_rows].reshape(r.contacts, r.tangents)

    @cached_property
    def residuals(self) -> Residuals:
        """How exact this solution is, computed from the program anew."""
        program, reduced = self.reduced.program, self.reduced
        dynamics = program.inertia @ (self.velocity - program.free_velocity)
        dynamics -= program.rows().T @ self.impulse
        rows = np.abs(reduced.residual(self.impulse, self.speed))
        pushed = self.normal_impulse[reduced.limits :] * program.unilateral.friction
        outside = np.linalg.norm(self.tangent_impulse, axis=1) - pushed
        return Residuals(
            dynamics=float(np.abs(dynamics).max(initial=0.0)),
            law=float(rows[: reduced.elements].max(initial=0.0)),
            complementarity=float(rows[reduced.normal_rows].max(initial=0.0)),
            cone=float(outside.max(initial=0.0)) if reduced.tangents else 0.0,
            friction=float(rows[reduced.tangent_rows].max(initial=0.0)),
        )
