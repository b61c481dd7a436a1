"""Finding the direction of power of every gear together with the motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.rows.torque_rows import place_doubtful
from wbc.control.solvers import QPSolution, QPStatus
from wbc.control.solvers.cascade import Cascade
from wbc.control.solvers.problem import is_finite
from wbc.control.torque.direction_branching import DirectionBranching
from wbc.control.torque.gears import Slopes
from wbc.control.torque.solution_torques import Limits, beyond_limits

_ACTIVE = 1e-6
SMALL = 1e-6
"""[N m], output torque under which a gear's direction does not matter."""
GUESSES = 3
"""How often directions are turned over before they are searched."""
_NONE: IntArray = np.zeros(0, dtype=np.int_)


class DirectedSolution(NamedTuple):
    """A solution whose directions are right.

    Attributes:
        solution: of the last program solved.
        output: T (m,) [N m].
        share: what the rotors take themselves (m,) [N m].
        rounds: programs solved.
        solve_time: [s] in the solver.
        proven: whether no other choice of directions can cost less.
        acceleration: qdd (nv,).
        iterations: of the solvers.
        settled: whether the solution agrees with the directions it was computed with, as far as
            limits depend on them.
        blocking: what could not be kept beside the other constraints, "" where that is unknown.
    """

    solution: QPSolution
    output: FloatArray
    share: FloatArray
    rounds: int
    solve_time: float
    proven: bool
    acceleration: FloatArray
    iterations: int = 0
    blocking: str = ""
    settled: bool = True


class DirectionSearch:
    """Solves the contact-force program with the directions of its own solution.

    Of all rows only the torque limits depend on the directions, and of those only the ones that
    bind. A guess, from the last tick, is therefore right almost always; where it is not, the gears
    that differ are turned over and the program is solved again.

    With forward slope >= backward slope (eta_f eta_b <= 1), N tau_phi is a convex function of T
    in a gear that turns one way and a concave one the other way. A limit on the convex side is
    two linear rows, so a solution that agrees with its directions is the best of all 2^m choices
    unless a limit binds on the other side (a motor that brakes with all it has). There the allowed
    set is the union of two half-spaces, one per direction, and the search branches on them: every
    node keeps the convex rows of all gears and one half-space of the gears decided so far, which
    bounds the cost of all that lies below it.
    """

    def __init__(
        self, program: ContactForceProgram, plain: Cascade, branching: Cascade, rounds: int
    ) -> None:
        """Take the solvers of one program.

        Args:
            program: the program; its torque rows are written by the search.
            plain: solves it.
            branching: solves it with a second row for every gear that has a limit.
            rounds: programs solved at most in one tick.
        """
        self.program, self._plain, self._rounds = program, plain, rounds
        self._branching = DirectionBranching(program, branching)

    def solve(
        self,
        positive: BoolArray,
        slopes: Slopes,
        limits: Limits,
        speed: FloatArray,
        last_output: FloatArray,
        *,
        starts_over: bool = False,
    ) -> DirectedSolution:
        """Return the solution of the assembled program with directions that agree with it.

        Args:
            positive: (m,) guess of where T > 0.
            slopes: of the mesh law for either sign of T.
            limits: least and greatest N tau_phi (m,) [N m].
            speed: expected dpsi (m,) [rad/s], for efforts.
            last_output: T (m,) of the last tick [N m], for efforts.
            starts_over: whether the rows that bound the last solution are not worth a try.
        """
        program, near = self.program, None
        self._plain.start_tick()
        self._branching.solver.start_tick()
        for _ in range(min(GUESSES, self._rounds)):
            slope = slopes.at(positive)
            program.assemble_torque_limits(slope, *limits)
            program.assemble_efforts(slope, speed, last_output)
            solution = self._plain.solve(program.blocks, starts_over=starts_over)
            starts_over = False
            solved = solution.status is QPStatus.SOLVED
            if solved or is_finite(solution.x):
                near = solution.x
            if not solved:
                break
            turned, contested = self._doubtful(positive, slopes, limits, solution)
            if turned is None:
                if not contested.size:
                    return self._found(solution, True)
                return self._branch(slopes, limits, solution, contested, positive, solution, near)
            positive = np.where(turned, ~positive, positive)
        if not program.gears.size or np.array_equal(slopes.positive, slopes.negative):
            if not solved and solution.status is not QPStatus.INFEASIBLE:
                return self._feasible(slopes, limits, solution, near)
            return self._found(solution, False)
        if (
            solved
            and program.efforts
            and not beyond_limits(program, solution, slopes, limits).any()
        ):
            return self._found(solution, False)
        return self._branch(slopes, limits, None, _NONE, positive, solution, near)

    def forget(self) -> None:
        """Start the next tick from nothing."""
        self._plain.forget()
        self._branching.solver.forget()

    def _found(self, solution: QPSolution, proven: bool) -> DirectedSolution:
        output, share = self.program.torques(solution.x)
        acceleration = solution.x[: self.program.nv].copy()
        plain, branching = self._plain, self._branching.solver
        rounds, spent = plain.count + branching.count, plain.spent + branching.spent
        steps = max(plain.iterations, branching.iterations)  # the latter goes on from the former
        return DirectedSolution(
            solution, output, share, rounds, spent, proven, acceleration, steps, self._blocking()
        )

    def _blocking(self) -> str:
        """Return what could not be kept beside the other constraints."""
        row = self._plain.blocking
        return "" if row < 0 else self.program.rows.labels[row]

    def _doubtful(
        self, positive: BoolArray, slopes: Slopes, limits: Limits, solution: QPSolution
    ) -> tuple[BoolArray | None, IntArray]:
        """Return which directions are wrong in a way that counts, and which could be either.

        The former are the gears (m,) whose guess changes the solution, None where there are none.
        The latter are numbers of the gears at a limit on the side where the allowed set is a union.
        """
        program = self.program
        output, _, beyond = program.judged(solution.x, slopes, limits)
        turned, contested = np.empty((2, len(output)), dtype=np.bool_)
        push = solution.z[program.rows.torque]
        any_turned, any_contested = place_doubtful(
            *(output, beyond, *slopes, positive, program.gears, push),
            *(bool(program.efforts), SMALL, _ACTIVE, turned, contested),
        )
        gears = np.flatnonzero(contested) if any_contested else _NONE
        return turned if any_turned else None, gears

    def _branch(
        self,
        slopes: Slopes,
        limits: Limits,
        incumbent: QPSolution | None,
        contested: IntArray,
        positive: BoolArray,
        unsolved: QPSolution,
        near: FloatArray | None,
    ) -> DirectedSolution:
        """Return the best solution over all directions, or the best within the rounds left."""
        self._branching.solver.start_tick(self._plain.iterations)
        left = self._rounds - self._plain.count
        found, proven = self._branching.solve(
            slopes, limits, incumbent, contested.tolist(), positive, left
        )
        if found is not None:
            return self._found(found, proven)
        self.program.assemble_torque_limits(slopes.at(positive), *limits)  # a node's rows are fewer
        if proven or unsolved.status is QPStatus.INFEASIBLE:
            return self._found(unsolved, proven)._replace(settled=False)
        return self._feasible(slopes, limits, unsolved, near)

    def _feasible(
        self, slopes: Slopes, limits: Limits, unsolved: QPSolution, near: FloatArray | None
    ) -> DirectedSolution:
        """Return an allowed motion near where the budget ended, what was unsolved if there is none.

        The dual method comes to the best motion from outside of what the constraints allow: where
        it is stopped, its x breaks some of them, and the nearest x that breaks none is commanded.
        """
        if near is not None:
            self._branching.solver.start_tick(
                max(self._plain.iterations, self._branching.solver.iterations)
            )
            found = self._branching.feasible(near, slopes, limits)
            if found is not None:
                return self._found(found, False)
        return self._found(unsolved, False)._replace(settled=False)
