"""How usable the solution of a tick's program is."""

from __future__ import annotations

from wbc.control.command import Status
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.safety.inputs import Complaint, all_finite
from wbc.control.solvers import QPStatus
from wbc.control.torque.direction_search import DirectedSolution

_ACCURATE = 1e-4


def judged(found: DirectedSolution, program: ContactForceProgram) -> Complaint:
    """Return how usable a solution is, and what is in its way."""
    solution = found.solution
    if solution.status is QPStatus.SOLVED:
        if all_finite(solution.x):
            if found.settled:
                return Status.SOLVED, ""
            return (
                Status.INACCURATE,
                "directions of power not settled; torques clipped.",
            )
        return Status.FAILED, "the solver returned values that are not finite."
    if solution.status is QPStatus.INFEASIBLE:
        what = found.blocking or "a constraint"
        return Status.INFEASIBLE, f"{what} cannot be kept beside the others; see explain()."
    if solution.status is QPStatus.ITERATION_LIMIT and all_finite(solution.x):
        residual = program.blocks.violation(solution.x)
        if residual < _ACCURATE:
            return (
                Status.INACCURATE,
                f"iteration limit; constraints are kept within {residual:.1e}.",
            )
    return Status.FAILED, f"no solution within {found.rounds} programs; see explain()."
