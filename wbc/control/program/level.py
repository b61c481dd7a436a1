"""One level of priority: its tasks, its program, and the two ways of solving it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.command import Status
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.level_lock import LevelLock
from wbc.control.program.task_stack import TaskStack
from wbc.control.program.usual_tick import (
    TOO_LARGE,
    Passed,
    UsualArguments,
    UsualTick,
    greatest_asked,
)
from wbc.control.reference import Reference
from wbc.control.safety.inputs import Complaint
from wbc.control.safety.verdict import judged
from wbc.control.solvers import DualActiveSet, QPProblem, QPSolution, QPStatus
from wbc.control.torque.direction_search import GUESSES, SMALL, DirectedSolution, DirectionSearch
from wbc.control.torque.gears import GearLaw, GearState
from wbc.control.torque.torque_stage import Realised, RotorTorqueStage
from wbc.robot import Motion

_BINDS = 1e-6
_SOLVED: Complaint = (Status.SOLVED, "")


class Answer(NamedTuple):
    """A usable solution, the rotor torques that bring it about, and how usable they are."""

    found: DirectedSolution
    realised: Realised
    verdict: Complaint

    def without_lower(self, complaint: Complaint) -> Answer:
        """Return the answer of a level whose next one has only a complaint."""
        message = f"the tasks of a lower level are left out: {complaint[1]}"
        return self._replace(verdict=(Status.INACCURATE, message))


class Refusal(NamedTuple):
    """Why there is no usable solution; no complaint where the program's numbers are too large."""

    complaint: Complaint | None
    found: DirectedSolution | None
    level: Level


class Level:
    """Solves one level's program of one set of contacts.

    Attributes:
        program: of the level.
        usual: does a usual tick in one call; None where a tick is never usual.
    """

    def __init__(
        self,
        tasks: TaskStack,
        program: ContactForceProgram,
        lock: LevelLock | None,
        search: DirectionSearch,
        guess: DualActiveSet | None,
        law: GearLaw,
        stage: RotorTorqueStage,
        tolerance: float,
        usual: UsualTick | None,
    ) -> None:
        """Take the parts.

        Args:
            tasks: of the level.
            program: what is to be solved.
            lock: holds what the more important level decided; None where there is none.
            search: solves it with the directions of its own solution.
            guess: tried before the search; None where every tick goes to the solver.
            law: of the meshes.
            stage: finds the rotor torques.
            tolerance: of the solvers.
            usual: does a usual tick in one call, None where a tick is never usual.
        """
        self._greatest, self.usual = greatest_asked(tolerance), usual
        self._tasks, self._lock, self.program = tasks, lock, program
        self._search, self._guess, self._law, self._stage = search, guess, law, stage
        self._output = np.zeros(0)
        self._saturated = self._whole = self._solvable = False

    def forget(self) -> None:
        """Start the next tick without the rows that bound the last one."""
        self._saturated = False
        self._search.forget()
        if self._guess is not None:
            self._guess.forget()

    def assemble(
        self,
        motion: Motion,
        references: Mapping[str, Reference],
        contacts: Mapping[str, float] | None,
        dt: float,
        gears: GearState,
        above: Answer | None,
    ) -> None:
        """Write what both ways of solving need.

        Args:
            motion: the state.
            references: of the tick.
            contacts: greatest normal force [N] of each active contact, or None.
            dt: time until the next tick [s].
            gears: of the tick.
            above: what the level above has decided.
        """
        program = self.program
        program.assemble_constraints(motion.position, motion.velocity, dt, contacts)
        program.assemble_forces(references)
        if self._lock is not None and above is not None:
            self._lock_decided(self._lock, above.found, gears)
        self._solvable = program.assemble_tasks(self._tasks) < self._greatest

    def pass_usual(
        self,
        motion: Motion,
        asked: UsualArguments,
        dt: float,
        expected: FloatArray,
        last_output: FloatArray,
    ) -> Passed | None:
        """Do a usual tick in one call; None where it is none.

        Args:
            motion: the state.
            asked: references, contacts, weights and activation of `Controller.step`.
            dt: time until the next tick [s].
            expected: v (nv,) [rad/s] expected of this state.
            last_output: T (m,) of the last tick [N m].

        Raises:
            ControlError: a reference that does not fit its task.
        """
        usual = self.usual
        if usual is None or not usual.prepare(motion, *asked, dt):
            return None
        tries = not self._saturated
        passed = usual.run(motion, expected, last_output, dt, tries=tries)
        self._whole, self._output = False, passed.block[usual.at.output]
        return passed

    def finish(self, passed: Passed, first: FloatArray) -> Answer | Refusal:
        """Return what `solve` would where a usual tick ended early."""
        if passed.ended == TOO_LARGE:
            return Refusal(None, None, self)
        self._whole = True
        return self._searched(passed.gears, first, starts_over=not self._saturated)

    def _lock_decided(self, lock: LevelLock, found: DirectedSolution, gears: GearState) -> None:
        """Hold what the level above has decided, with the rows of torque limits that bound it."""
        push, rows = found.solution.z, self.program.rows
        limited = bool(push[rows.torque].any() or push[len(rows.lower) :].any())
        if limited:
            self._assemble_whole()
            slope = self._law.slopes(gears.sigma).at(found.output > 0.0)
            self.program.assemble_torque_limits(slope, *gears.limits)
        lock.assemble(found.solution.x, limited=limited)

    def solve(self, gears: GearState, first: FloatArray) -> Answer | Refusal:
        """Return the solution with the directions of its own torques, or why there is none.

        Args:
            gears: of the tick.
            first: T (m,) whose signs are the first guess, of the last tick or the level above.
        """
        self._whole = False
        if not self._solvable:
            return Refusal(None, None, self)
        guessed = self._guess is not None and not self._saturated
        if self._guess is not None and guessed:
            answer = self._guessed(self._guess, gears, first)
            if answer is not None:
                return answer
        self._whole = True
        return self._searched(gears, first, starts_over=guessed)

    def problem(self, gears: GearState | None) -> QPProblem:
        """Return a copy of the program of the last tick, in the directions of its solution."""
        if not self._whole and gears is not None:
            return self.built(gears, self._output)
        return self.program.blocks.dense().copied()

    def built(self, gears: GearState, output: FloatArray) -> QPProblem:
        """Return the program as assembled, in the directions of some output torques T (m,)."""
        self._assemble_whole()
        program, slope = self.program, self._law.slopes(gears.sigma).at(output > 0.0)
        program.assemble_torque_limits(slope, *gears.limits)
        program.assemble_efforts(slope, gears.speed, gears.last_output)
        return program.blocks.dense().copied()

    def _guessed(self, guess: DualActiveSet, gears: GearState, first: FloatArray) -> Answer | None:
        """Return the answer if no torque limit binds, None where the guess fails."""
        if self.program.efforts:
            return self._guessed_with_efforts(guess, gears, first)
        start = perf_counter()
        solution = guess.guess(self.program.unbound, self.program.rows.torque.stop)
        if solution is None:
            return None
        return self._exact(solution, gears, 1, perf_counter() - start)[1]

    def _guessed_with_efforts(
        self, guess: DualActiveSet, gears: GearState, first: FloatArray
    ) -> Answer | None:
        """Return the same where what efforts cost depends on the directions of the gears."""
        program, slopes, spent = self.program, self._law.slopes(gears.sigma), 0.0
        program.assemble_torque_map()
        positive, directional = first > 0.0, slopes.positive != slopes.negative
        for round_ in range(1, GUESSES + 1):
            program.effort_cost.fill(
                program.gear_torques.map, slopes.at(positive), gears.speed, gears.last_output
            )
            start = perf_counter()
            solution = guess.guess(program.unbound, program.rows.torque.stop)
            spent += perf_counter() - start
            if solution is None:
                return None
            output, answer = self._exact(solution, gears, round_, spent)
            turned = (output > 0.0) != positive
            turned &= directional & (np.abs(output) > SMALL)
            if not turned.any():
                return answer
            positive ^= turned
        return None

    def _exact(
        self, solution: QPSolution, gears: GearState, rounds: int, spent: float
    ) -> tuple[FloatArray, Answer | None]:
        """Return T (m,) of a solution, and the answer if the torque limits leave all of it."""
        x, program = solution.x, self.program
        output, share, realised = self._stage.realised(program.terms(x), gears.sigma, gears.limits)
        self._output = output
        if realised is None:
            return output, None
        found = DirectedSolution(
            solution, output, share, rounds, spent, True, x[: program.nv], solution.iterations
        )
        return output, Answer(found, realised, _SOLVED)

    def _searched(
        self, gears: GearState, first: FloatArray, *, starts_over: bool
    ) -> Answer | Refusal:
        self._assemble_whole()
        program = self.program
        found = self._search.solve(
            first > 0.0,
            self._law.slopes(gears.sigma),
            gears.limits,
            gears.speed,
            gears.last_output,
            starts_over=starts_over,
        )
        self._output = found.output
        verdict = judged(found, program)
        if not verdict[0].usable:
            return Refusal(verdict, found, self)
        push = found.solution.z[program.rows.torque]
        stopped = found.solution.status is not QPStatus.SOLVED
        self._saturated = stopped or bool((abs(push) > _BINDS).any())
        if self._guess is not None:
            self._guess.learn(found.solution.z[program.rows.torque.stop :])
        return Answer(found, self._realise(found, gears), verdict)

    def _realise(self, found: DirectedSolution, gears: GearState) -> Realised:
        return self._stage.solve(found.output, found.share, gears.sigma, gears.limits)

    def _assemble_whole(self) -> None:
        self.program.assemble_torque_map()


Tick = tuple[Motion, Mapping[str, Reference], Mapping[str, float] | None, float, GearState]
"""What `Level.assemble` needs of a tick, in its order."""


def descend(
    levels: Sequence[Level], tick: Tick, last_output: FloatArray
) -> tuple[Level, Answer | Refusal]:
    """Solve one level after the other; one that finds nothing leaves it at those above.

    Args:
        levels: the most important first.
        tick: motion, references, contacts, time step and gears.
        last_output: T (m,) of the last tick [N m].

    Returns:
        the last level that was solved, or could not be, and what came of it.
    """
    first, *lower = levels
    first.assemble(*tick, None)
    reached, answer = first, first.solve(tick[4], last_output)
    for level in lower:
        if isinstance(answer, Refusal):
            break
        level.assemble(*tick, answer)
        deeper = level.solve(tick[4], answer.found.output)
        if isinstance(deeper, Refusal) and deeper.complaint is not None:
            return reached, answer.without_lower(deeper.complaint)
        reached, answer = level, deeper
    return reached, answer
