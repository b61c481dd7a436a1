"""A step program seen from its rows: G v = free + delassus @ impulse (Delassus form)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.sim.laws.elements import Elements
from wbc.sim.solve.branches import pieces_at
from wbc.sim.solve.in_velocities import fewer_products
from wbc.sim.step.program import StepProgram

NOT_POSITIVE = (
    "the inertia matrix of the links is not positive definite: some body without mass moves "
    "freely. Give every moving body a mass."
)
IN_IMPULSES = np.empty((0, 0))
"""`Reduced.ways` of a step whose systems are solved in impulses."""


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
        delassus: G H^-1 G' (r, r).
        free: (r,) row speeds without impulses.
        diagonal: (r,) of `delassus`, made positive where a row moves nothing.
        spring: (r,) compliance with which rows hold on to a split of forces that is left open.
        slope: (r,) [impulse/speed] of the line on which each row meets its law.
        laws: (m, 9) per element up, down, inertia, 1/eta_f, eta_b, friction, damping, stiffness
            and preload of the spring in series.
        targets: (l + k,) of limits and normals.
        frictions: mu (k,) of the contacts.
        elements: m, number of dissipative rows.
        limits: l; rows m .. m + l.
        contacts: k; normals are rows m + l .. m + l + k.
        tangents: d per contact; the last k d rows.
        ways: W' (r, n), W'W = delassus, where that is less work (`fewer_products`); else (0, 0).
    """

    program: StepProgram
    response: FloatArray
    delassus: FloatArray
    free: FloatArray
    diagonal: FloatArray
    spring: FloatArray
    slope: FloatArray
    laws: FloatArray
    targets: FloatArray
    frictions: FloatArray
    elements: int
    limits: int
    contacts: int
    tangents: int
    ways: FloatArray

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

    def residual(self, impulse: FloatArray, speed: FloatArray) -> FloatArray:
        """Return how far rows (r,) at impulses and speeds are from their laws, as speeds."""
        pieces, sliding = np.empty((len(impulse), 4)), np.empty((self.contacts, 3))
        sizes = (self.laws, self.targets, self.frictions, self.tangents)
        pieces_at(*sizes, self.slope, impulse, speed, pieces, sliding)
        return pieces[:, 3]

    def distance(self, impulse: FloatArray) -> float:
        """Return how far the row farthest from its law is at row impulses (r,), as a speed."""
        distance = np.abs(self.residual(impulse, self.speeds(impulse)))
        return float(distance.max(initial=0.0)) if not np.isnan(distance).any() else np.inf

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
    upper, response, info = lapack.dposv(program.inertia, rows.T)
    if info != 0:
        if not np.isfinite(program.inertia).all():
            raise blown_up(program.inertia, program.free_velocity)
        raise SimulationError(NOT_POSITIVE)
    delassus, ways = rows @ response, IN_IMPULSES
    if fewer_products(len(rows), len(program.inertia)):
        ways = np.ascontiguousarray(lapack.dtrtrs(upper, rows.T, trans=1)[0].T)
    free = rows @ program.free_velocity
    if unilateral.ground is not None:
        free[m + len(unilateral.limits) :] -= unilateral.ground
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
        row_laws(elements),
        unilateral.target,
        unilateral.friction,
        m,
        len(unilateral.limits),
        k,
        d,
        ways,
    )


def row_laws(elements: Elements) -> FloatArray:
    """Return `Reduced.laws` of some elements."""
    e = elements
    return np.column_stack(
        (
            *(e.up, e.down, e.inertia, 1.0 / e.forward, e.backward),
            *(e.friction, e.damping, e.stiffness, e.preload),
        )
    )
