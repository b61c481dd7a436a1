"""What the solution of a program asks of the rotors, and which of their limits it breaks."""

from __future__ import annotations

from wbc.arrays import BoolArray, FloatArray
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.solvers import QPSolution
from wbc.control.torque.gears import Slopes

Limits = tuple[FloatArray, FloatArray]
"""Least and greatest N tau_phi (m,) [N m]."""


def beyond_limits(
    program: ContactForceProgram, solution: QPSolution, slopes: Slopes, limits: Limits
) -> BoolArray:
    """Return the gears (m,) whose torque by the mesh law is beyond their limits."""
    return program.judged(solution.x, slopes, limits).beyond
