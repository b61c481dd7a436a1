"""Finding the direction of power of every gear together with the motion."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.control.qp.active_set import (
    CONTRADICTION,
    FEW,
    STEPS,
    place_multipliers,
    settle,
)
from wbc.control.qp.gear_rows import (
    place_beyond,
    place_map,
    place_output,
    place_slopes,
)
from wbc.control.qp.lock_rows import let_pass
from wbc.control.qp.program import REACH, Program
from wbc.control.qp.solvers import SOLVERS, QPSolution, QPStatus, solve
from wbc.control.tick import COST, FIRST, GUESSES, HARD, SMALL, place_directed_rows, place_efforts

# Share of the rounds in which a better solution than the first is looked for: of 771 hostile ticks
# of four robots that have one all keep their torques with none of 9 rounds in place of 3.
_BETTER = 9
# Share of the iterations that is left for limits that give way: of 66 hostile ticks of Talos that
# have a motion one is missed with 0, 0.2, 0.33 or 0.4, none with 0.1.
_LEFT = 0.1
_EMPTY = np.zeros(0)
NOTHING = QPSolution(_EMPTY, _EMPTY, _EMPTY, QPStatus.FAILED, 0)
CONTRADICTORY = NOTHING._replace(status=QPStatus.INFEASIBLE)


_ACTIVE = 1e-6
_Node = tuple[float, Mapping[int, bool], IntArray]
"""A bound of its cost, the gears it decides and whether T > 0 in them, and bounds to start from."""


class DirectedSolution(NamedTuple):
    """What a search came to.

    Attributes:
        solution: of the last program solved.
        decided: gears whose direction the last program decides, and whether T > 0 in them.
        settled: whether the torques agree with the mesh law within the limits.
        rounds: programs solved.
        iterations: of the solvers.
        solve_time: [s] in the solvers.
    """

    solution: QPSolution
    decided: Mapping[int, bool]
    settled: bool
    rounds: int
    iterations: int
    solve_time: float


class DirectionSearch:
    """Solves the contact-force program over all directions that the gears can have.

    With forward slope >= backward slope (eta_f eta_b <= 1), N tau_phi is a convex function of T
    in a gear that turns one way and a concave one the other way. A limit on the convex side is
    two linear rows, whatever the direction. One on the other side (a motor that brakes with all it
    has) leaves the union of two half-spaces, one per direction. Every program holds the convex rows
    of all gears, and one half-space of the gears that it decides.

    The first one decides all gears as the last tick left them. Gears whose half-space binds at a
    torque of the other sign are turned over. Where no half-space binds in the end, the solution is
    the best of all 2^m choices, as nearly always; else the other direction of such a gear might be
    better, and the search branches on these. What a program costs bounds the cost of all that lies
    below it. Where the first one has no solution, the search begins with the convex rows alone,
    and decides gears whose torque is beyond their limits: until there is a solution it dives, each
    time in the directions that the torques have; then it takes the program of least bound first.

    Efforts depend on the directions as well: those of the solution are taken, a few times over.

    Attributes:
        output: T (m,) of the last solution, which the next one overwrites.
        rounds, iterations: programs solved, and iterations of solvers, since `start`.
    """

    def __init__(self, program: Program, guesses: bool) -> None:
        """Take a program.

        Args:
            program: the program.
            guesses: whether the rows that bound the last solution are tried before the solvers.
        """
        settings, m = program.recipe.settings, program.memory.gears.driven.shape[0]
        self._program, self._guesses = program, guesses
        self._names, self._tolerance = SOLVERS[settings.solver], settings.tolerance
        self._settings, self._rounds = settings, settings.max_rounds
        self.output, self._share = np.empty(m), np.empty(m)
        self._passing: FloatArray | None = None

    def start(self, sigma: FloatArray, passing: FloatArray | None) -> None:
        """Write what all programs of a tick share, and count anew.

        Args:
            sigma: certainty of the gears (m,).
            passing: x (n,) of the level above, which bounds let pass; None where there is none.
        """
        memory, self._passing = self._program.memory, passing
        jacobian, scale = memory.contacts.rows.jacobian, self._program.force_scale
        place_slopes(memory.gears, sigma, memory.slopes[1], memory.slopes[0])
        place_map(memory.gears, jacobian, scale, memory.map, memory.output_bias)
        self.rounds, self.iterations, self._spent = 0, 0, 0.0
        self.blocking = -1

    def place(self, decided: Mapping[int, bool], output: FloatArray) -> None:
        """Write the rows of torque limits where some gears are decided, and those of efforts."""
        program, memory, choice = self._program, self._program.memory, np.zeros(len(output))
        for gear, positive in decided.items():
            choice[gear] = 1.0 if positive else -1.0
        place_directed_rows(memory, choice)
        if program.has_efforts:
            place_efforts(memory, (output > 0.0).astype(np.int_))
        if self._passing is not None:
            slack = REACH * memory.numbers[3]
            let_pass(memory, program.lock, self._passing, slack, 0, program.torque.stop)

    def solve(
        self,
        output: FloatArray,
        decided: Mapping[int, bool],
        *,
        spare: int = 0,
        relaxes: bool = False,
    ) -> DirectedSolution:
        """Return the best solution over all directions, or the best within the rounds.

        Args:
            output: T (m,) whose signs the efforts begin with, and the directions.
            decided: gears that are decided, and whether T > 0 in them.
            spare: how many of the rounds are left for limits that give way; where there are some,
                the first contradiction is an answer.
            relaxes: whether to end with the first solution, and to go on with the convex rows alone
                where these directions contradict the others.
        """
        last, efforts, slopes = self._rounds - spare, GUESSES, self._program.memory.slopes
        self._most = int((1.0 - _LEFT * (spare > 0)) * self._settings.max_iterations)
        while True:
            found = self._branch(output, decided, last, spare > 0, relaxes)
            efforts -= 1
            differs = ((self.output > 0.0) != (output > 0.0)) & (slopes[0] != slopes[1])
            turned = bool((differs & (np.abs(self.output) > SMALL)).any())
            again = self._program.has_efforts and turned and found.settled
            if not again or efforts == 0 or self.rounds >= last:
                return found
            output = self.output.copy()

    def _branch(
        self,
        output: FloatArray,
        decided: Mapping[int, bool],
        last: int,
        quick: bool,
        relaxes: bool,
    ) -> DirectedSolution:
        """Return the solution of least cost with the efforts of some torques (m,)."""
        taken, lowest = self._program.memory.solver.taken, np.inf
        gears, positive = self._program.gears.tolist(), (output > 0.0).tolist()
        guess = {gear: positive[gear] for gear in gears} | dict(decided)
        nodes: list[_Node] = [(-np.inf, decided, taken.copy())]
        if len(guess) > len(decided):
            nodes.append((-np.inf, guess, taken.copy()))
        best: tuple[QPSolution, Mapping[int, bool]] | None = None
        relaxed, refused, failed = NOTHING, NOTHING, decided
        while nodes and self.rounds < max(last, 1) and self.iterations < self._most:
            if best is not None:  # the least bound first; before, the last one is the deepest
                nodes.sort(key=lambda entry: -entry[0])
            bound, node, taken[:] = nodes.pop()
            if bound >= lowest:
                break
            self.place(node, output)
            solution = self._solved()
            if solution.status is not QPStatus.SOLVED:
                refused, failed = (solution, node) if refused is NOTHING else (refused, failed)
                if quick and not (relaxes and node is guess):
                    break
                continue
            cost, beyond = self._program.cost(solution.x), self._beyond(solution.x)
            gears = [gear for gear in np.flatnonzero(beyond).tolist() if gear not in node]
            if cost >= lowest:
                continue
            if not gears:
                if node is guess or best is None:
                    sides = self._contested(solution, node, decided)
                    nodes = _turned(decided, sides, -np.inf, taken.copy())
                    wrong = {g: not up for g, up in sides.items() if (self.output[g] > 0.0) != up}
                    if wrong:
                        guess = {**node, **wrong}
                        nodes.append((-np.inf, guess, taken.copy()))
                    else:
                        last = min(last, self.rounds + self._rounds // _BETTER)
                best, lowest = (solution, node), cost
                if relaxes:
                    break
                continue
            relaxed, sides = solution, {gear: bool(self.output[gear] > 0.0) for gear in gears}
            nodes += _turned(node, sides, cost, taken.copy())
            nodes.append((cost, {**node, **sides}, taken.copy()))
        if best is not None:
            return self._found(*best, settled=True)
        # where the budget ends, torques that have to be clipped are better than nothing
        proven = not nodes or (quick and refused.status is QPStatus.INFEASIBLE)
        fails = relaxed is NOTHING or proven
        return self._found(refused if fails else relaxed, failed, settled=False)

    def refuted(self) -> DirectedSolution:
        """Return what a tick came to whose bounds contradict one another without torque limits."""
        self.rounds, self.blocking = 1, int(self._program.memory.solver.active[0])
        return self._found(CONTRADICTORY, {}, settled=False)

    def _contested(
        self, solution: QPSolution, node: Mapping[int, bool], decided: Mapping[int, bool]
    ) -> dict[int, bool]:
        """Return the gears whose half-space binds in a solution, and whether T > 0 in it.

        With those directions it is the best, whatever the others are.
        """
        gears, slopes, found = self._program.gears.tolist(), self._program.memory.slopes, {}
        for row, gear in enumerate(gears):
            if gear in node and gear not in decided:
                push = solution.z[row + len(gears) * node[gear]]
                convex = slopes[1, gear] >= slopes[0, gear]
                if slopes[1, gear] != slopes[0, gear] and (-push if convex else push) > _ACTIVE:
                    found[gear] = node[gear]
        return found

    def _found(
        self, solution: QPSolution, decided: Mapping[int, bool], *, settled: bool
    ) -> DirectedSolution:
        if solution.status is QPStatus.SOLVED:
            self._beyond(solution.x)
        return DirectedSolution(
            solution, decided, settled, self.rounds, self.iterations, self._spent
        )

    def _beyond(self, x: FloatArray) -> BoolArray:
        """Write T of x (n,); return the gears (m,) whose torque is beyond their limits."""
        memory, scale = self._program.memory, self._program.force_scale
        jacobian, beyond = memory.contacts.rows.jacobian, np.empty(len(self.output), np.bool_)
        place_output(memory.gears, jacobian, scale, x, self.output, self._share)
        place_beyond(memory.gears, self.output, self._share, memory.slopes, beyond)
        return beyond

    def _solved(self) -> QPSolution:
        """Return the solution of the program as it stands, or one that is not SOLVED.

        From the rows that bound the last solution, if these are worth a try; else the first that a
        solver finds. What a solver finds is solved once more from the rows that bind in it: to the
        last digits.
        """
        start, found = perf_counter(), NOTHING
        self.rounds += 1
        if self._guesses:
            found = self._guessed()
        if found is NOTHING:
            dense, give = self._program.dense(), self._program.memory.solver.give
            for name in self._names:
                most = max(self._most - self.iterations, 1)
                found = solve(name, dense, tolerance=self._tolerance, most=most, give=give)
                self.iterations += found.iterations
                # alone ProxQP calls programs infeasible that leave hardly any room
                sure = name == "daqp" and found.status is QPStatus.INFEASIBLE
                if found.status is QPStatus.SOLVED or sure:
                    break
            if found.status is QPStatus.SOLVED and self._guesses:
                pushing = np.abs(found.z) > 10.0 * self._tolerance
                self._program.memory.solver.taken[:] = np.sign(found.z) * pushing
                exact = self._guessed()
                found = exact if exact.status is QPStatus.SOLVED else found
        self._spent += perf_counter() - start
        return found

    def _guessed(self) -> QPSolution:
        """Return the solution from the rows taken as binding, NOTHING where they lead to none."""
        program, memory = self._program, self._program.memory
        solver, counts = memory.solver, memory.counts
        first, hard, bounds = int(counts[FIRST]), int(counts[HARD]), len(solver.lower)
        last = int(counts[COST]) + hard
        x, y, z = np.empty(program.n), np.empty(hard), np.empty(bounds)
        # where so many steps were in vain, more of them are hardly worth a try
        steps = max(STEPS - int(solver.steps[0]), FEW)
        size = settle(solver, first, last, (0, bounds), self._tolerance, steps, x)
        if size == CONTRADICTION:
            self.blocking = int(solver.active[0])
        if size < 0:
            return CONTRADICTORY if size == CONTRADICTION else NOTHING
        place_multipliers(solver, last - first, last - first - hard, size, y, z)
        return QPSolution(x, y, z, QPStatus.SOLVED, 0)


def _turned(
    node: Mapping[int, bool], sides: Mapping[int, bool], cost: float, taken: IntArray
) -> list[_Node]:
    """Return the parts of a node in which at least one gear is on another side than these."""
    found, own = list[_Node](), dict(node)
    for gear, side in sides.items():
        found.append((cost, {**own, gear: not side}, taken))
        own[gear] = side
    return found
