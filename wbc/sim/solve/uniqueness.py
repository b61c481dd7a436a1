"""When a step with self-locking gears has one solution."""

from __future__ import annotations

import numpy as np

from wbc.errors import SimulationError
from wbc.sim.laws.elements import falling_rows
from wbc.sim.solve.reduced import Reduced

_SLOWEST = 1e-9
"""[rad/s] below which two solutions count as one."""


def check_uniqueness(reduced: Reduced) -> None:
    """Check that the step has no more than one solution.

    A self-locking gear that turns has a falling branch, M w + eta_b T = up with eta_b < 0. With
    those rows' compliance Lambda the step is a strictly monotone problem, and its solution unique,
    where Lambda + diag(eta_b / M) is positive definite. Any other row may be rigid in another
    solution (a gear that sticks, a point that holds), and a rigid row lowers Lambda most: they are
    all taken out of it.

    Raises:
        SimulationError: the condition fails.
    """
    rows = np.flatnonzero(falling_rows(reduced.program.elements, _SLOWEST))
    if rows.size == 0:
        return
    elements = reduced.program.elements
    rest = np.setdiff1d(np.arange(len(reduced.free)), rows)
    own = reduced.delassus[np.ix_(rows, rows)]
    cross = reduced.delassus[np.ix_(rows, rest)]
    held = reduced.delassus[np.ix_(rest, rest)]
    own = own - cross @ np.linalg.pinv(held, hermitian=True, rcond=1e-10) @ cross.T
    margin = np.linalg.eigvalsh(own + np.diag(elements.backward[rows] / elements.inertia[rows]))
    if margin[0] <= 0.0:
        raise SimulationError(
            f"self-locking gears (rows {rows.tolist()} of the step) turn against so light a rotor "
            f"that the step may have several solutions: Lambda + diag(eta_b/(N^2 I_r)) has the "
            f"eigenvalue {margin[0]:.3g} 1/(kg m^2), it must be positive. Give the gear more "
            "rotor inertia or a backward efficiency nearer to zero."
        )
