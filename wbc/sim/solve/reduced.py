"""A step program seen from its rows: w = free + compliance @ impulse (Delassus form)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.sim.laws.elements import Elements
from wbc.sim.step.program import StepProgram

NOT_POSITIVE = (
    "the inertia matrix of the links is not positive definite: some body without mass moves "
    "freely. Give every moving body a mass."
)


def blown_up(inertia: FloatArray, velocity: FloatArray) -> SimulationError:
    """Return the error for a step whose inertia was good once and is no longer.

    Args:
        inertia: H_l (n, n).
        velocity: v (n,) before the step.
    """
    symmetric = np.triu(inertia) + np.triu(inertia, 1).T
    with np.errstate(all="ignore"):
        energy = 0.5 * float(velocity @ symmetric @ velocity)
        fastest = float(np.abs(velocity).max(initial=0.0))
    numbers = "the step has no numbers: " if np.isnan(velocity).any() else ""
    return SimulationError(
        f"{numbers}the state has blown up: {energy:.3g} J of kinetic energy, fastest coordinate "
        f"{fastest:.3g} rad/s (m/s). Look at the events of the steps before, and at the torques."
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
        spring: (r,) compliance with which rows hold on to a split of forces that is left open.
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
    spring: FloatArray
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
        if not np.isfinite(program.inertia).all():
            raise blown_up(program.inertia, program.free_velocity)
        raise SimulationError(NOT_POSITIVE)
    delassus = rows @ response
    free = rows @ program.free_velocity
    if m:
        delassus.ravel()[: m * (len(free) + 1) : len(free) + 1] += elements.compliance
        free[:m] += elements.offset
    own = delassus.diagonal().tolist()
    floor = max(1e-9 * max(own, default=0.0), 1e-21)
    own = [max(value, floor) for value in own]
    slopes = [1.0 / value for value in own]
    d = unilateral.tangent_size
    if d == 2:
        for j in range(m + len(unilateral.target), len(own), 2):
            slopes[j] = slopes[j + 1] = 1.0 / (own[j] + own[j + 1])
    for i, backward in enumerate(elements.backward.tolist()):
        if backward < 0.0:
            slopes[i] = min(slopes[i], 0.5 * float(elements.inertia[i]) / -backward)
    diagonal = np.array(own)
    return Reduced(
        program,
        response,
        delassus,
        free,
        diagonal,
        1e-9 * diagonal,
        np.array(slopes),
        slopes,
        row_laws(elements, slopes[:m]),
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
    laws = row_laws(reduced.program.elements, slopes[: reduced.elements])
    return replace(reduced, slope=slope, slopes=slopes, laws=laws)


def row_laws(elements: Elements, slopes: list[float]) -> list[tuple[float, ...]]:
    """Return `Reduced.laws` of some elements on lines of some slopes."""
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
