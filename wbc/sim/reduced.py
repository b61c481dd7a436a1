"""A step program seen from its rows: w = free + compliance @ impulse (Delassus form)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.sim.elements import Elements
from wbc.sim.program import StepProgram

NOT_POSITIVE = (
    "the inertia matrix of the links is not positive definite (or not finite): some body without "
    "mass moves freely. Give every moving body a mass."
)


@dataclass(frozen=True, eq=False, slots=True)
class Reduced:
    """What the solvers work on.

    Attributes:
        program: where it came from.
        response: H^-1 G' (n, r), velocity per row impulse.
        delassus: G H^-1 G' (r, r), with the elements' own compliance on the diagonal.
        free: (r,) row speeds without impulses.
        diagonal: (r,) of `delassus`, made positive where a row moves nothing.
        slope: (r,) [impulse/speed] of the line on which each row meets its law.
        slopes: the same as plain floats, for the loops over rows.
        laws: per element up, down, inertia, 1/eta_f, eta_b, friction, damping, slope.
        targets: of limits and normals.
        frictions: mu of the contacts.
        elements: m, number of dissipative rows.
        limits: l; rows m .. m + l.
        contacts: k; normals are rows m + l .. m + l + k.
        tangents: d per contact; the last k d rows.
    """

    program: StepProgram
    response: FloatArray
    delassus: FloatArray
    free: FloatArray
    diagonal: FloatArray
    slope: FloatArray
    slopes: list[float]
    laws: list[tuple[float, ...]]
    targets: list[float]
    frictions: list[float]
    elements: int
    limits: int
    contacts: int
    tangents: int

    @property
    def normal_rows(self) -> slice:
        """Limits and contact normals."""
        return slice(self.elements, self.elements + self.limits + self.contacts)

    @property
    def tangent_rows(self) -> slice:
        """Contact tangents."""
        return slice(self.elements + self.limits + self.contacts, len(self.free))

    def velocity(self, impulse: FloatArray) -> FloatArray:
        """Return v (n,) after row impulses (r,)."""
        return np.asarray(self.program.free_velocity + self.response @ impulse)

    def speeds(self, impulse: FloatArray) -> FloatArray:
        """Return the row speeds (r,) after row impulses (r,)."""
        return np.asarray(self.free + self.delassus @ impulse)


def reduce_program(program: StepProgram) -> Reduced:
    """Return the Delassus form of a program.

    Raises:
        SimulationError: the link inertia is not positive definite.
    """
    rows = program.rows()
    elements, unilateral = program.elements, program.unilateral
    m, k = elements.size, len(unilateral.normals)
    _, response, info = lapack.dposv(program.inertia, rows.T)
    if info != 0:
        raise SimulationError(NOT_POSITIVE)
    delassus = rows @ response
    free = rows @ program.free_velocity
    if m:
        own = np.arange(m)
        delassus[own, own] += elements.compliance
        free[:m] += elements.offset
    diagonal = delassus.diagonal().copy()
    floor = 1e-9 * max(diagonal.tolist(), default=1e-12)
    np.maximum(diagonal, max(floor, 1e-21), out=diagonal)
    d = unilateral.tangent_size
    slope = 1.0 / diagonal
    first = m + len(unilateral.limits) + k
    for j in range(first, len(free), max(d, 1)):
        slope[j : j + d] = 1.0 / diagonal[j : j + d].sum()
    if m and min(elements.backward.tolist()) < 0.0:
        safe = 0.5 * elements.inertia / np.maximum(-elements.backward, 1e-300)
        np.minimum(slope[:m], safe, out=slope[:m])
    slopes = slope.tolist()
    return Reduced(
        program,
        response,
        delassus,
        free,
        diagonal,
        slope,
        slopes,
        _laws(elements, slopes[:m]),
        unilateral.target.tolist(),
        unilateral.friction.tolist(),
        m,
        len(unilateral.limits),
        k,
        d,
    )


def with_slope(reduced: Reduced, slope: FloatArray) -> Reduced:
    """Return the same step looked at along lines of another slope (r,)."""
    slopes = slope.tolist()
    laws = _laws(reduced.program.elements, slopes[: reduced.elements])
    return replace(reduced, slope=slope, slopes=slopes, laws=laws)


def _laws(elements: Elements, slopes: list[float]) -> list[tuple[float, ...]]:
    return list(
        zip(
            elements.up.tolist(),
            elements.down.tolist(),
            elements.inertia.tolist(),
            (1.0 / elements.forward).tolist(),
            elements.backward.tolist(),
            elements.friction.tolist(),
            elements.damping.tolist(),
            slopes,
            strict=True,
        )
    )
