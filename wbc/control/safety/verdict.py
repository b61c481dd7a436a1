"""How usable the solution of a tick's program is."""

from __future__ import annotations

from wbc.control.command import Status
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.safety.conflict import Conflict
from wbc.control.safety.inputs import Complaint, all_finite
from wbc.control.solvers import QPStatus
from wbc.control.torque.direction_search import Found


def judged(found: Found, program: ContactForceProgram) -> Complaint:
    """Return how usable a solution is, and what is in its way."""
    solution = found.solution
    if not all_finite(solution.x):
        return Status.FAILED, "the solver returned values that are not finite."
    if solution.status is QPStatus.SOLVED:
        return Status.SOLVED, ""
    if solution.status is QPStatus.ITERATION_LIMIT:
        residual = solution.primal_residual(program.problem)
        if residual < 1e-4:
            return Status.INACCURATE, f"iteration limit, residual {residual:.1e}."
    conflict = Conflict.of(program)
    status = Status.INFEASIBLE if conflict.residual > 1e-4 else Status.FAILED
    return status, conflict.message
