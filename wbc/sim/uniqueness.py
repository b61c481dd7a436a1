"""When a step with self-locking gears has one solution."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.sim.branches import branches_at
from wbc.sim.elements import falling_rows
from wbc.sim.reduced import Reduced

_SLOWEST = 1e-9
"""[rad/s] below which two solutions count as one."""


def check_uniqueness(reduced: Reduced, impulse: FloatArray) -> None:
    """Check that no other solution exists beside `impulse` (r,).

    A self-locking gear that turns has a falling branch, M w + eta_b T = up with eta_b < 0. With
    those rows' compliance Lambda the step is a monotone problem, and its solution unique, if and
    only if Lambda + diag(eta_b / M) is positive definite; rows that are rigid in this solution
    (stuck gears, sticking contacts) are first taken out of Lambda.

    Raises:
        SimulationError: the condition fails.
    """
    rows = np.flatnonzero(falling_rows(reduced.program.elements, _SLOWEST))
    if rows.size == 0:
        return
    elements = reduced.program.elements
    branches = branches_at(reduced, impulse, reduced.speeds(impulse))
    rigid = branches.on_impulse == 0.0
    rigid[rows] = False
    own = reduced.delassus[np.ix_(rows, rows)]
    cross = reduced.delassus[np.ix_(rows, rigid)]
    held = reduced.delassus[np.ix_(rigid, rigid)]
    own = own - cross @ np.linalg.pinv(held, hermitian=True, rcond=1e-10) @ cross.T
    margin = np.linalg.eigvalsh(own + np.diag(elements.backward[rows] / elements.inertia[rows]))
    if margin[0] <= 0.0:
        raise SimulationError(
            f"self-locking gears (rows {rows.tolist()} of the step) turn against so light a rotor "
            f"that the step has several solutions: Lambda + diag(eta_b/(N^2 I_r)) has the "
            f"eigenvalue {margin[0]:.3g} 1/(kg m^2), it must be positive. Give the gear more "
            "rotor inertia or a backward efficiency nearer to zero."
        )
