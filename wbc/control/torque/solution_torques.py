"""What the solution of a program asks of the rotors, and which of their limits it breaks."""

from __future__ import annotations

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.rows.torque_rows import place_beyond
from wbc.control.solvers import QPSolution
from wbc.control.torque.gears import Slopes

Limits = tuple[FloatArray, FloatArray]
"""Least and greatest N tau_phi (m,) [N m]."""


def beyond_limits(
    program: ContactForceProgram, solution: QPSolution, slopes: Slopes, limits: Limits
) -> BoolArray:
    """Return the gears (m,) whose torque by the mesh law is beyond their limits."""
    output, share = program.torques(solution.x)
    beyond = np.empty(len(output), dtype=np.bool_)
    place_beyond(output, share, slopes.positive, slopes.negative, *limits, beyond)
    return beyond
