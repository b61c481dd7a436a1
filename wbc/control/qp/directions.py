"""Finding the direction of power of every gear together with the motion."""

from __future__ import annotations

from heapq import heappop, heappush
from itertools import count
from time import perf_counter
from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.control.qp.active_set import CONTRADICTION, UNSETTLED, place_multipliers, settle
from wbc.control.qp.gear_rows import (
    place_beyond,
    place_directed_rows,
    place_map,
    place_output,
    place_slopes,
    place_torque_rows,
)
from wbc.control.qp.lock_rows import let_pass
from wbc.control.qp.problem import QPSolution, QPStatus
from wbc.control.qp.program import REACH, Program
from wbc.control.qp.solvers import solve
from wbc.control.tick import COST, FIRST, GUESSES, HARD, SMALL, place_efforts

_ACTIVE = 1e-6
# Share of the rounds in which a better solution than the first is looked for: of 259 hostile ticks
# of Solo12 that have one all keep their torques with 3 rounds in place of 7, and the longest takes
# 1.6 in place of 2.1 ms.
_BETTER = 3
_NONE: IntArray = np.zeros(0, dtype=np.int_)
_EMPTY = np.zeros(0)
CONTRADICTORY = QPSolution(_EMPTY, _EMPTY, _EMPTY, QPStatus.INFEASIBLE, 0)
NOTHING = QPSolution(_EMPTY, _EMPTY, _EMPTY, QPStatus.FAILED, 0)


class DirectedSolution(NamedTuple):
    """What a search came to.

    Attributes:
        solution: of the last program solved.
        rounds: programs solved.
        iterations: of the solvers.
        solve_time: [s] in the solvers.
        settled: whether the solution agrees with the directions it was computed with, as far as
            limits depend on them.
        blocking: what could not be kept beside the other constraints, "" where that is unknown.
    """

    solution: QPSolution
    rounds: int
    iterations: int
    solve_time: float
    settled: bool
    blocking: str


class ProgramSolver:
    """Solves a program: from the rows that bound the last solution, where that fails by a solver.

    What a solver found is solved once more from the rows that bind in it: to the last digits.

    Attributes:
        count, iterations, spent: programs, iterations of solvers and [s] since `start_tick`.
        blocking: bound that a program could not keep beside the others, -1 where that is unknown.
    """

    def __init__(self, program: Program, names: tuple[str, ...], *, guesses: bool) -> None:
        """Take a program and solvers.

        Args:
            program: the program.
            names: of the solvers, each asked where those before it fail.
            guesses: whether the rows that bound the last solution are tried.
        """
        self._program, self._names, self._guesses = program, names, guesses
        settings = program.recipe.settings
        self._tolerance, self._most = settings.tolerance, settings.max_iterations
        self.start_tick()

    def start_tick(self) -> None:
        """Count anew."""
        self.count, self.iterations, self.spent, self.blocking = 0, 0, 0.0, -1
        self._climbs = True

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._program.memory.solver.taken[:] = 0

    @property
    def exhausted(self) -> bool:
        """Whether the iterations are spent."""
        return self.iterations >= self._most

    def solve(self, *, directed: bool = False, starts_over: bool = False) -> QPSolution:
        """Return the solution of the program as it stands, or one that is not SOLVED.

        Args:
            directed: whether every gear has two rows.
            starts_over: whether the rows that bound the last solution are not worth a try.
        """
        start = perf_counter()
        self.count += 1
        if starts_over:
            self._program.memory.solver.taken[:] = 0
        found = self._guessed(directed) if self._guesses else NOTHING
        if found is NOTHING:
            found = self._asked(directed)
        self.spent += perf_counter() - start
        return found

    def _guessed(self, directed: bool) -> QPSolution:
        """Return the solution from the rows taken as binding, where they lead to it or to none."""
        program, memory = self._program, self._program.memory
        solver, counts = memory.solver, memory.counts
        first, hard = int(counts[FIRST]), int(counts[HARD])
        last = int(counts[COST]) + hard
        bounds = len(solver.lower) if directed else program.plain
        x, y, z = np.empty(program.n), np.empty(hard), np.empty(bounds)
        # limits that give way bind by the dozen, and of 92 such programs of Talos none settled; nor
        # did of 88 that followed one which did not
        climbs = self._climbs and not solver.give.any()
        size = settle(solver, first, last, (0, bounds), self._tolerance, climbs, x)
        self._climbs = self._climbs and (size != UNSETTLED or not climbs)
        if size == CONTRADICTION:
            row = int(solver.active[0])
            self.blocking = row if row < program.plain else row - program.plain
        if size < 0:
            return CONTRADICTORY if size == CONTRADICTION else NOTHING
        place_multipliers(solver, last - first, last - first - hard, size, y, z)
        return QPSolution(x, program.with_hard_tasks(y), z, QPStatus.SOLVED, 0)

    def _asked(self, directed: bool) -> QPSolution:
        """Return what the solvers say, the first one that finds a solution."""
        blocks, found = self._program.blocks(directed=directed), NOTHING
        dense = blocks.dense()
        for name in self._names:
            most = max(self._most - self.iterations, 1)
            found = solve(name, dense, tolerance=self._tolerance, most=most, give=blocks.give)
            self.iterations += found.iterations
            # alone ProxQP calls programs infeasible that leave hardly any room
            sure = name == "daqp" or self.blocking >= 0
            if found.status is QPStatus.SOLVED or (sure and found.status is QPStatus.INFEASIBLE):
                break
        if found.status is QPStatus.SOLVED and self._guesses:
            pushing = np.abs(found.z) > 10.0 * self._tolerance
            self._program.memory.solver.taken[: len(found.z)] = np.sign(found.z) * pushing
            exact = self._guessed(directed)
            return exact if exact.status is QPStatus.SOLVED else found
        return found


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
    bounds the cost of all that lies below it. Until there is a first solution it dives, each time
    in the direction that the node's own torque has; then it takes the node of least bound first.

    Attributes:
        directions: (m,) where T > 0 in the plain program written last.
    """

    def __init__(self, program: Program, solver: ProgramSolver) -> None:
        """Take a program, and what solves it."""
        self._program, self._solver, self._rounds = program, solver, 0
        m = program.memory.gears.driven.shape[0]
        self._positive, self._negative = np.empty(m), np.empty(m)
        self._output, self._share = np.empty(m), np.empty(m)
        self._passing: FloatArray | None = None
        self.directions: BoolArray = np.zeros(m, dtype=np.bool_)

    def lay_out(self, sigma: FloatArray, passing: FloatArray | None) -> None:
        """Write what all programs of a tick share.

        Args:
            sigma: certainty of the gears (m,).
            passing: x (n,) of the level above, which bounds let pass; None where there is none.
        """
        program, memory = self._program, self._program.memory
        jacobian, scale = memory.contacts.rows.jacobian, program.force_scale
        place_slopes(memory.gears, sigma, self._positive, self._negative)
        place_map(memory.gears, jacobian, scale, memory.limited.map, memory.limited.output_bias)
        self._passing = passing

    def direct(self, positive: BoolArray) -> None:
        """Write the rows of torque limits and efforts in some directions (m,) of T."""
        memory, self.directions = self._program.memory, positive
        place_torque_rows(memory.limited, np.where(positive, self._positive, self._negative))
        if self._program.has_efforts:
            place_efforts(memory, positive.astype(np.int_))
        self._let_pass(self._program.torque)

    def _let_pass(self, rows: slice) -> None:
        program = self._program
        if self._passing is not None:
            slack = REACH * program.memory.numbers[3]
            let_pass(program.memory, program.lock, self._passing, slack, rows.start, rows.stop)

    def solve(
        self, first: FloatArray, rounds: int, *, quick: bool = False, branches: bool = True
    ) -> DirectedSolution:
        """Return the solution with directions that agree with it; call after `lay_out`.

        Args:
            first: T (m,) whose signs are the first guess.
            rounds: how many programs there may be since the solver's `start_tick`.
            quick: whether the first contradiction is an answer: no other directions are tried.
            branches: whether directions are tried beside those that solutions have.
        """
        program, positive, self._rounds = self._program, first > 0.0, rounds
        usable: tuple[QPSolution, BoolArray] | None = None
        for _ in range(max(min(GUESSES, rounds - self._solver.count), 1)):
            self.direct(positive)
            solution = self._solver.solve()
            solved = solution.status is QPStatus.SOLVED
            if solution.status is QPStatus.INFEASIBLE and quick:
                return self._found(solution, settled=True)
            if not solved:
                break
            usable = solution, positive
            turned, contested = self._doubtful(positive, solution)
            if not turned.any():
                if not contested.size or not branches:
                    return self._found(solution, settled=True)
                return self._branch(solution, contested, positive, solution)
            positive = positive ^ turned
        if not program.gears.size or np.array_equal(self._positive, self._negative):
            return self._found(solution, settled=True)
        # where the budget ends, directions that do not agree are better than nothing
        if usable is not None and (not branches or self._solver.exhausted):
            solution, positive = usable
        if not branches:
            self.direct(positive)
            return self._found(solution, settled=False)
        if solved and program.has_efforts and not self._beyond(solution).any():
            return self._found(solution, settled=True)
        return self._branch(None, _NONE, positive, solution)

    def possible(self, first: FloatArray, rounds: int) -> tuple[DirectedSolution, FloatArray]:
        """Return a solution in whatever directions there is one, and T (m,) that tells them.

        Without a solution of the convex rows of all gears there is none in any directions; its own
        are tried where it is none yet. Arguments as for `solve`.
        """
        self._place_node({})
        relaxed = self._solver.solve(directed=True, starts_over=True)
        if relaxed.status is not QPStatus.SOLVED:
            return self._found(relaxed, settled=True), first
        beyond, leading = self._beyond(relaxed).any(), self._output.copy()
        if not beyond:
            return self._plain(relaxed), leading
        found = self.solve(leading, rounds, branches=False)
        if found.solution.status is QPStatus.SOLVED:
            leading = np.array(self.output_of(found.solution))
        return found, leading

    def _found(self, solution: QPSolution, *, settled: bool) -> DirectedSolution:
        solver, row = self._solver, self._solver.blocking
        what = "" if row < 0 else self._program.labels[row]
        taken = solver.count, solver.iterations, solver.spent
        return DirectedSolution(solution, *taken, settled, what)

    def output_of(self, solution: QPSolution) -> FloatArray:
        """Return T (m,) of a solution, which the next one overwrites."""
        self._beyond(solution)
        return self._output

    def _beyond(self, solution: QPSolution) -> BoolArray:
        """Return the gears (m,) whose torque by the mesh law is beyond their limits."""
        memory, program = self._program.memory, self._program
        jacobian, scale = memory.contacts.rows.jacobian, program.force_scale
        place_output(memory.gears, jacobian, scale, solution.x, self._output, self._share)
        beyond = np.empty(len(self._output), dtype=np.bool_)
        torques = self._output, self._share, self._positive, self._negative
        place_beyond(memory.gears, *torques, beyond)
        return beyond

    def _doubtful(self, positive: BoolArray, solution: QPSolution) -> tuple[BoolArray, IntArray]:
        """Return which gears (m,) turn the other way than guessed, and which could turn either way.

        A wrong guess counts where the gear is beyond its limits or pushes at them, or where efforts
        depend on it. At a limit that is a union of half-spaces, one per direction, the other
        direction might be better.
        """
        program, beyond = self._program, self._beyond(solution)
        push = np.zeros(len(positive))
        push[program.gears] = solution.z[program.torque]
        differs = self._positive != self._negative
        convex = self._positive > self._negative
        contested = differs & np.where(convex, push < -_ACTIVE, push > _ACTIVE)
        counts = beyond | (np.abs(push) > _ACTIVE) | program.has_efforts
        wrong = ((self._output > 0.0) != positive) & differs & (np.abs(self._output) > SMALL)
        return wrong & counts, np.flatnonzero(contested)

    def _branch(
        self,
        incumbent: QPSolution | None,
        contested: IntArray,
        positive: BoolArray,
        unsolved: QPSolution,
    ) -> DirectedSolution:
        """Return the best solution over all directions, or the best within the rounds left.

        Args:
            incumbent: a solution that agrees with its directions, or None.
            contested: gears that `incumbent` decides where the other direction might be better.
            positive: (m,) where T > 0 in the incumbent.
            unsolved: what to return where nothing is found.
        """
        blocks, order = self._program.blocks(), count()
        lowest = np.inf if incumbent is None else blocks.cost(incumbent.x)
        nodes: list[tuple[float, int, dict[int, bool]]] = []
        decided: dict[int, bool] = {}
        for gear in contested.tolist():
            heappush(nodes, (-np.inf, next(order), decided | {gear: not positive[gear]}))
            decided[gear] = bool(positive[gear])
        dive: list[dict[int, bool]] = [] if incumbent is not None else [{}]
        last = self._rounds
        while self._solver.count < last and not self._solver.exhausted:
            if incumbent is not None:
                last = min(last, self._solver.count + self._rounds // _BETTER)
            if dive:
                node = dive.pop()
            elif nodes and nodes[0][0] < lowest:
                node = heappop(nodes)[2]
            elif nodes and incumbent is None:
                # where to dive on after a dead end: the deepest node, while nothing is found
                deepest = max(nodes, key=lambda entry: (len(entry[2]), entry[1]))
                node = nodes.pop(nodes.index(deepest))[2]
                nodes.sort(key=lambda entry: entry[:2])
            else:
                break
            self._place_node(node)
            # of 291 nodes five were solved by the rows that bound another one
            solution = self._solver.solve(directed=True, starts_over=True)
            if solution.status is not QPStatus.SOLVED:
                continue
            cost = blocks.cost(solution.x)
            if cost >= lowest:
                continue
            open_gears = [
                g for g in np.flatnonzero(self._beyond(solution)).tolist() if g not in node
            ]
            if not open_gears:
                incumbent, lowest = solution, cost
                continue
            gear = open_gears[0]
            own = bool(self._output[gear] > 0.0)
            heappush(nodes, (cost, next(order), node | {gear: not own}))
            if incumbent is None:
                dive.append(node | {gear: own})
            else:
                heappush(nodes, (cost, next(order), node | {gear: own}))
        if incumbent is None:
            self.direct(positive)
            return self._found(unsolved, settled=False)
        return self._plain(incumbent)

    def _place_node(self, decided: dict[int, bool]) -> None:
        """Write the rows of a node; `decided` maps a gear to whether T > 0 there."""
        choice = np.zeros(len(self._output))
        for gear, positive in decided.items():
            choice[gear] = 1.0 if positive else -1.0
        program = self._program
        place_directed_rows(program.memory.limited, self._positive, self._negative, choice)
        self._let_pass(program.torque)
        self._let_pass(slice(program.plain, program.plain + len(program.gears)))

    def _plain(self, solution: QPSolution) -> DirectedSolution:
        """Write the plain program in the directions of a solution; return it with its rows' z.

        Of the two rows that a node has per gear, the one in the solution's own direction stays.
        """
        program = self._program
        self._beyond(solution)
        positive = self._output > 0.0
        self.direct(positive)
        if len(solution.z) == program.plain:
            return self._found(solution, settled=True)
        z, own = solution.z[: program.plain].copy(), positive[program.gears]
        z[program.torque] = np.where(own, solution.z[program.plain :], z[program.torque])
        return self._found(solution._replace(z=z), settled=True)
