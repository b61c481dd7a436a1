"""One step as a program: link inertia, free velocity, dissipative rows and unilateral rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.sim.laws.elements import Elements


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
