"""Quadratic programs, what a solver says about one, and the solvers behind the own guess."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from math import isqrt
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import daqp
import numpy as np
from proxsuite import proxqp

from wbc.arrays import FloatArray
from wbc.errors import ControlError
from wbc.files import atomic_write

INFINITE = 1e20
"""What counts as no bound."""


class QPProblem(NamedTuple):
    """min 1/2 x'Hx + g'x  subject to  A x = b,  lower <= C x <= upper.

    Attributes:
        H: (n, n), positive semi-definite.
        g: (n,).
        A: (n_eq, n).
        b: (n_eq,).
        C: (n_in, n).
        lower: (n_in,); -INFINITE or less is no bound.
        upper: (n_in,); INFINITE or more is no bound.
    """

    H: FloatArray
    g: FloatArray
    A: FloatArray
    b: FloatArray
    C: FloatArray
    lower: FloatArray
    upper: FloatArray

    def save(self, path: str | Path) -> Path:
        """Write the program to a compressed `.npz` file, whole or not at all; return its path."""
        return atomic_write(path, lambda file: np.savez_compressed(file, **self._asdict()))

    @classmethod
    def load(cls, path: str | Path) -> QPProblem:
        """Read a program that `save` wrote.

        Raises:
            ControlError: no such file, or not one of these.
        """
        try:
            with np.load(path, allow_pickle=False) as archive:
                return cls(*(np.asarray(archive[name], dtype=np.float64) for name in cls._fields))
        except (OSError, ValueError, KeyError, BadZipFile) as cause:
            raise ControlError(f"'{path}' holds no saved program: {cause}.") from cause


class QPStatus(Enum):
    """How solving ended."""

    SOLVED = "solved"
    EASED = "eased"  # no point keeps all bounds: the best where some of them give way
    UNFINISHED = "unfinished"  # the work ended at a point that can be used, but is not the best
    INFEASIBLE = "infeasible"
    ITERATION_LIMIT = "iteration limit"
    FAILED = "failed"


class QPSolution(NamedTuple):
    """What a solver returned.

    Attributes:
        x: (n,).
        y: multipliers (n_eq,) of the equalities.
        z: multipliers (n_in,), positive at an upper bound, negative at a lower one.
        status: how it ended.
        iterations: of the solver.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    status: QPStatus
    iterations: int

    def residuals(self, problem: QPProblem) -> tuple[float, float, float]:
        """Return how far it is from an optimum, three numbers that are zero there.

        The largest violation of a constraint, the largest entry of |Hx + g + A'y + C'z|, and the
        duality gap |x'Hx + g'x + b'y + upper'z+ + lower'z-|.
        """
        (H, g, A, b, C, lower, upper), x, y, z = problem, self.x, self.y, self.z
        rows = C @ x
        broken = np.concatenate([np.abs(A @ x - b), rows - upper, lower - rows])
        gradient = H @ x + g + A.T @ y + C.T @ z
        bounded = np.where(upper < INFINITE, upper, 0.0) @ np.maximum(z, 0.0)
        bounded += np.where(lower > -INFINITE, lower, 0.0) @ np.minimum(z, 0.0)
        gap = abs(float(x @ H @ x + g @ x + b @ y + bounded))
        return float(broken.max(initial=0.0)), float(np.abs(gradient).max(initial=0.0)), gap


_PROXQP = {
    proxqp.PROXQP_SOLVED: QPStatus.SOLVED,
    proxqp.PROXQP_PRIMAL_INFEASIBLE: QPStatus.INFEASIBLE,
    proxqp.PROXQP_MAX_ITER_REACHED: QPStatus.ITERATION_LIMIT,
}
_EQUALITY = 5
_DAQP = {1: QPStatus.SOLVED, -1: QPStatus.INFEASIBLE, -4: QPStatus.ITERATION_LIMIT}
SOLVERS = ("daqp", "proxqp")
"""The solvers that can be asked; daqp is behind ProxQP.

ProxQP finds nothing where daqp does not: of 200 hostile ticks of Talos daqp failed in ten, and
ProxQP took 10 ms each to say the same.
"""


class WarmStart(Enum):
    """What a tick takes over from the last one.

    ACTIVE_SET tries the constraints that bound the last solution, in one small linear system whose
    solution is taken if it fulfils every condition of optimality; the solver is asked otherwise.
    SOLVER always asks the solver, which starts from nothing.
    """

    ACTIVE_SET = "active_set"
    SOLVER = "solver"


def solve(name: str, problem: QPProblem, *, tolerance: float, most: int) -> QPSolution:
    """Return the solution of a program whose numbers are finite and bounds ordered, from nothing.

    ProxQP would not return where bounds are not ordered. The duality gap is part of its stopping
    rule: without it a point that is feasible and stationary, but pushes against a bound that is
    elsewhere, may be returned as the solution.

    Args:
        name: "proxqp" or "daqp".
        problem: the program.
        tolerance: absolute, on residuals.
        most: iterations, inner and outer ones together.
    """
    H, g, A, b, C, lower, upper = problem
    if name == "daqp":
        bounds = [(np.concatenate([b, lower]), np.concatenate([b, upper]))]
        rows = np.concatenate([A, C])
        return Daqp().solve(H, g, rows, bounds, len(b), tolerance=tolerance, most=most)[-1]
    backend = proxqp.dense.DenseBackend.PrimalDualLDLT
    qp = proxqp.dense.QP(len(g), len(b), len(lower), dense_backend=backend)
    settings = qp.settings
    settings.eps_abs, settings.eps_rel = tolerance, 0.0
    settings.check_duality_gap = True
    settings.eps_duality_gap_abs = 10.0 * tolerance
    settings.eps_duality_gap_rel = tolerance
    settings.eps_primal_inf = 1e-14
    settings.max_iter = max(isqrt(2 * most), 1)
    settings.max_iter_in = max(most // settings.max_iter, 1)
    qp.init(H, g, A, b, C, lower, upper)
    qp.solve()
    found, info = qp.results, qp.results.info
    x, y, z = np.array(found.x), np.array(found.y), np.array(found.z)
    return QPSolution(x, y, z, _PROXQP.get(info.status, QPStatus.FAILED), int(info.iter))


class Daqp:
    """daqp (Arnstrom, Bemporad & Axehill 2022), which needs a positive definite H.

    It finishes in a number of steps that grows with the constraints that bind, and says at once
    when none can be met. Every program begins from nothing, in the memory of the last one where it
    has as many rows.
    """

    def __init__(self) -> None:
        """Begin without memory."""
        self._model, self._sizes = daqp.Model(), (0, 0)

    def solve(
        self,
        H: FloatArray,
        g: FloatArray,
        rows: FloatArray,
        bounds: Sequence[tuple[FloatArray, FloatArray]],
        equalities: int,
        *,
        tolerance: float,
        most: int,
    ) -> list[QPSolution]:
        """Return the solutions of a program with ever tighter bounds, up to the first without one.

        Each one begins with the bounds that bind in the one before.

        Args:
            H, g: as of a `QPProblem`.
            rows: A over C.
            bounds: lower and upper ones of the rows, at least one pair.
            equalities: how many rows A has.
            tolerance: absolute, on residuals.
            most: iterations of all solutions together.
        """
        model, sizes, found = self._model, (equalities, len(rows)), list[QPSolution]()
        # rows that are equalities are eliminated: half the time of an iteration
        limits = {"primal_tol": tolerance, "dual_tol": tolerance, "eq_reduction": 1}
        sense = np.zeros(len(rows), dtype=np.int32)
        sense[:equalities] = _EQUALITY
        for lower, upper in bounds:
            model.settings = limits | {"iter_limit": max(most, 1)}
            if found:
                flag = model.update(blower=lower, bupper=upper)
            elif self._sizes == sizes:
                flag = model.update(H, g, rows, upper, lower, sense)
            else:
                flag, self._sizes = model.setup(H, g, rows, upper, lower, sense)[0], sizes
            if flag < 0:
                self._sizes, none = (0, 0), np.zeros(len(rows))
                y, z = none[:equalities], none[equalities:]
                return [QPSolution(np.zeros(len(g)), y, z, QPStatus.FAILED, 0)]
            x, _, flag, info = model.solve()
            y, z = info["lam"][:equalities], info["lam"][equalities:]
            status, most = _DAQP.get(flag, QPStatus.FAILED), most - info["iterations"]
            found.append(QPSolution(x, y, z, status, info["iterations"]))
            if status is not QPStatus.SOLVED:
                break
        return found
