"""Why a tick had no solution, found when somebody asks."""

from __future__ import annotations

import numpy as np
from proxsuite import proxqp

from wbc.control.command import Command
from wbc.errors import ControlError

_KEPT = 1e-4


def explain(command: Command) -> str:
    """Return in one sentence why a tick had no solution; empty where nothing is in the way.

    For a program whose constraints contradict one another it names the one that the
    closest-to-feasible motion breaks most, and by how much. It solves a second program, which may
    break constraints in the least-squares sense and take a hundred times as long as a tick: ask
    outside the loop.

    Raises:
        ControlError: this is no command.
    """
    if not isinstance(command, Command):
        raise ControlError(f"explain takes a Command, got {type(command).__name__}.")
    if command.refused is None:
        return command.message
    problem, names = command.refused.problem.dense(), command.refused.names
    qp = proxqp.dense.QP(len(problem.g), len(problem.b), len(problem.lower))
    qp.settings.primal_infeasibility_solving = True
    qp.settings.max_iter = qp.settings.max_iter_in = 200
    qp.init(*problem)
    qp.solve()
    x = np.array(qp.results.x)
    if not np.isfinite(x).all():
        return "the program cannot be kept: its numbers are too large."
    rows = problem.C @ x
    beyond = np.maximum(np.maximum(rows - problem.upper, problem.lower - rows), 0.0)
    broken = np.concatenate([np.abs(problem.A @ x - problem.b), beyond])
    worst = int(np.argmax(broken)) if broken.size else -1
    if worst < 0 or broken[worst] <= _KEPT:
        return "a motion that keeps all constraints exists; the solver did not find it."
    scale = 1.0
    if worst < len(problem.b):
        name, unit = names.equality_label(worst)
    else:
        name, scale, unit = names.inequality_label(worst - len(problem.b))
    return f"{name} cannot be kept: {scale * broken[worst]:.3g} {unit} missing."
