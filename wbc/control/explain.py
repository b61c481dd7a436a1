"""Why a tick had no solution, found when somebody asks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from proxsuite import proxqp

from wbc.control.command import Command, RowNames
from wbc.control.qp.problem import QPProblem
from wbc.errors import ControlError


@dataclass(frozen=True)
class Conflict:
    """The constraint that the closest-to-feasible motion still breaks most.

    Attributes:
        name: of the constraint.
        residual: by how much, as the program counts it, accelerations and forces of one size.
        missing: the same in the row's own unit.
        unit: N m, N, m/s^2 or rad/s^2.
    """

    name: str
    residual: float
    missing: float
    unit: str

    @property
    def message(self) -> str:
        """The sentence for a command's message."""
        if self.residual <= 1e-4:
            return "a motion that keeps all constraints exists; the solver did not find it."
        return f"{self.name} cannot be kept: {self.missing:.3g} {self.unit} missing."

    @classmethod
    def of(cls, problem: QPProblem, names: RowNames) -> Conflict:
        """Return the worst row of a problem whose rows have these names.

        Solves a second program that is allowed to break constraints in the least-squares sense;
        this may take a hundred times as long as a tick.
        """
        qp = proxqp.dense.QP(len(problem.g), len(problem.b), len(problem.lower))
        qp.settings.primal_infeasibility_solving = True
        qp.settings.max_iter = 200
        qp.settings.max_iter_in = 200
        qp.init(*problem)
        qp.solve()
        x = np.array(qp.results.x)
        if not np.isfinite(x).all():
            return cls("the program", float("inf"), float("inf"), "")
        balance = np.abs(problem.A @ x - problem.b)
        rows = problem.C @ x
        beyond = np.maximum(np.maximum(rows - problem.upper, problem.lower - rows), 0.0)
        worst_balance = int(np.argmax(balance)) if balance.size else -1
        worst_row = int(np.argmax(beyond)) if beyond.size else -1
        in_balance = float(balance[worst_balance]) if balance.size else 0.0
        in_rows = float(beyond[worst_row]) if beyond.size else 0.0
        if in_balance >= in_rows:
            name, unit = names.equality_label(worst_balance)
            return cls(name, in_balance, in_balance, unit)
        name, scale, unit = names.inequality_label(worst_row)
        return cls(name, in_rows, scale * in_rows, unit)


def explain(command: Command) -> str:
    """Return in one sentence why a tick had no solution; empty where nothing is in the way.

    For a program whose constraints contradict one another it names the one that the
    closest-to-feasible motion breaks most, and by how much. It solves a second program, which may
    take a hundred times as long as a tick: ask outside the loop.

    Raises:
        ControlError: this is no command.
    """
    if not isinstance(command, Command):
        raise ControlError(f"explain takes a Command, got {type(command).__name__}.")
    refused = command.refused
    if refused is None:
        return command.message
    return Conflict.of(refused.problem.dense(), refused.names).message
