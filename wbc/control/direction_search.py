"""Finding the direction of power of every gear together with the motion."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.control.gears import Slopes
from wbc.control.program import ContactForceProgram
from wbc.control.qp import INFINITE, QPProblem, QPSolution, QPStatus, Solver, make_solver


@dataclass(frozen=True, eq=False, slots=True)
class Found:
    """A solution whose directions are right.

    Attributes:
        solution: of the last program solved.
        output: T (m,) [N m].
        rounds: programs solved.
        solve_time: [s] in the solver.
    """

    solution: QPSolution
    output: FloatArray
    rounds: int
    solve_time: float


class DirectionSearch:
    """Solves the contact-force program with the directions of its own solution.

    Only the torque limits (and torque costs) depend on the directions, and of those only the rows
    that bind. A guess, from the last tick, is therefore right almost always; where it is not, the
    gears that differ are turned over and the program is solved again. Should they turn back and
    forth, the search goes on with the sign of every T held: at T = 0 both directions agree, so
    turning over a gear whose sign row pushes never makes the cost worse, and the search ends.
    """

    def __init__(
        self,
        program: ContactForceProgram,
        solver_name: str,
        tolerance: float,
        iterations: int,
        rounds: int,
    ) -> None:
        """Make the solvers of one program."""
        self.program = program
        self._solver_name, self._tolerance = solver_name, tolerance
        self._iterations, self._rounds = iterations, rounds
        rows = len(program.row_labels)
        self._solver = self._make(rows)
        self._guarded: Solver | None = None

    def _make(self, rows: int) -> Solver:
        return make_solver(
            self._solver_name,
            self.program.n,
            len(self.program.b),
            rows,
            tolerance=self._tolerance,
            max_iterations=self._iterations,
        )

    def solve(
        self,
        positive: BoolArray,
        slopes: Slopes,
        limits: tuple[FloatArray, FloatArray],
    ) -> Found:
        """Return the solution of the assembled program with directions that agree with it.

        Args:
            positive: (m,) guess of where T > 0.
            slopes: of the mesh law for either sign of T.
            limits: least and greatest N tau_phi (m,) [N m].
        """
        spent, rounds = 0.0, 0
        for rounds in range(1, self._rounds + 1):
            self.program.assemble_torque_limits(slopes.at(positive), *limits)
            start = perf_counter()
            solution = self._solver.solve(self.program.problem)
            spent += perf_counter() - start
            if solution.status is QPStatus.INFEASIBLE and rounds == 1:
                positive = slopes.positive < slopes.negative
                continue
            output = self.program.output_torque(solution.x)
            if solution.status is not QPStatus.SOLVED:
                return Found(solution, output, rounds, spent)
            turned = self._turned(positive, output, slopes, limits, solution)
            if not turned.any():
                return Found(solution, output, rounds, spent)
            positive = np.where(turned, ~positive, positive)
        return self._descend(solution, positive, slopes, limits, rounds, spent)

    def _turned(
        self,
        positive: BoolArray,
        output: FloatArray,
        slopes: Slopes,
        limits: tuple[FloatArray, FloatArray],
        solution: QPSolution,
    ) -> BoolArray:
        """Return the gears (m,) whose guess was wrong in a way that changes the solution."""
        wrong = (output > 0.0) != positive
        wrong &= slopes.positive != slopes.negative
        if not wrong.any():
            return np.asarray(wrong)
        program = self.program
        share = program.plant.rotor @ solution.x[: program.nv] + program.plant.rotor_bias
        torque = slopes.at(~positive) * output + share
        slack = 1e-6 * (1.0 + np.abs(torque))
        beyond = (torque < limits[0] - slack) | (torque > limits[1] + slack)
        pushing = np.zeros(len(output), dtype=bool)
        pushing[program.gears] = np.abs(solution.z[program.torque_rows]) > 1e-6
        return np.asarray(wrong & (np.abs(output) > 1e-6) & (beyond | pushing))

    def _descend(
        self,
        unguarded: QPSolution,
        positive: BoolArray,
        slopes: Slopes,
        limits: tuple[FloatArray, FloatArray],
        rounds: int,
        spent: float,
    ) -> Found:
        program = self.program
        if self._guarded is None:
            self._guarded = self._make(len(program.row_labels) + len(positive))
        best = unguarded
        lowest = np.inf
        for _ in range(2 * len(positive) + 2):
            program.assemble_torque_limits(slopes.at(positive), *limits)
            start = perf_counter()
            solution = self._guarded.solve(guarded_problem(program, positive))
            spent += perf_counter() - start
            rounds += 1
            if solution.status is not QPStatus.SOLVED:
                break
            cost = 0.5 * solution.x @ program.H @ solution.x + program.g @ solution.x
            if cost >= lowest - 1e-9 * (1.0 + abs(cost)):
                break
            best, lowest = solution, float(cost)
            push = np.abs(solution.z[len(program.row_labels) :]) > 1e-5
            if not push.any():
                break
            positive = np.where(push, ~positive, positive)
        return Found(best, program.output_torque(best.x), rounds, spent)


def guarded_problem(program: ContactForceProgram, positive: BoolArray) -> QPProblem:
    """Return the assembled program with T >= 0 where `positive` (m,) and T <= 0 elsewhere."""
    plain, plant = program.problem, program.plant
    rows = np.hstack([plant.output, program.coupled_forces])
    offset = plant.output_bias
    return plain._replace(
        C=np.vstack([plain.C, rows]),
        lower=np.concatenate([plain.lower, np.where(positive, -offset, -INFINITE)]),
        upper=np.concatenate([plain.upper, np.where(positive, INFINITE, -offset)]),
    )
