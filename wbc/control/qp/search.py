"""Finding the direction of power of every gear together with the motion."""

from __future__ import annotations

from time import perf_counter
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import OutFlags, OutPlaces, OutRow, Places, Row, compiled, view
from wbc.control.command import Status
from wbc.control.inputs import Complaint
from wbc.control.memory import COUNT, GEAR, NUMBER, PART, ProgramMemory
from wbc.control.qp.active_set import FEW, STEPS, keep_hopeful, place_multipliers, settle
from wbc.control.qp.lock_rows import let_pass
from wbc.control.qp.program import REACH, Program, place_prices
from wbc.control.qp.solvers import Daqp, QPSolution, QPStatus, solve
from wbc.control.rows.gear_rows import (
    place_efforts,
    place_output,
    place_torque_limits,
    place_torques,
)
from wbc.mechanics.linear import dot

UNSOLVED, LIMITED_TORQUE, DONE = range(3)
"""How a guess ends: without a solution, with a torque limit, or well."""
GUESSES = 3
"""How often directions are turned over before they are searched."""
SMALL = 1e-6
"""[N m], output torque under which a gear's direction does not matter."""
# What it takes to write a program out and to begin it, to try bounds that may bind, and a step of
# that, in iterations of daqp.
_PROGRAM, _GUESS, _STEP = 70, 30, 2
# Share of the work up to which a better solution than the first is looked for. With all of it 12 of
# 155 hostile ticks of Solo12 would move better, and 11 of 77 of Talos, and the 99th percentile of
# Solo12 would be 740 us in place of 450.
_SEARCHED = 0.5
_ACTIVE = 1e-6
_EMPTY = np.zeros(0)
SOLVED: Complaint = (Status.SOLVED, "")
NOTHING = QPSolution(_EMPTY, _EMPTY, _EMPTY, QPStatus.FAILED, 0)
_Node = tuple[float, IntArray, IntArray]
"""A bound of its cost, the directions it decides, and bounds to start from."""


class DirectedSolution(NamedTuple):
    """What a search came to.

    Attributes:
        solution: of the last program solved.
        decided: (m,) 1 or -1 for the sign of T where the last program decides it, else 0.
        settled: whether the torques agree with the mesh law within the limits.
        rounds: programs solved.
        iterations: work of them, as `ControllerSettings.max_iterations` counts it.
        solve_time: [s] in the solvers.
        verdict: how usable the solution is, and what is in its way.
        excess: `Program.excess` where limits may be passed, else None.
    """

    solution: QPSolution
    decided: IntArray
    settled: bool
    rounds: int
    iterations: int
    solve_time: float
    verdict: Complaint = SOLVED
    excess: FloatArray | None = None


@compiled(counted=False)
def try_bounds(
    program: ProgramMemory, start: int, steps: int, x: OutRow, y: OutRow, z: OutRow
) -> tuple[int, int]:
    """Solve from the bounds taken as binding, see `settle`; return what that does.

    Args:
        program: PROGRAM.
        start: the first bound that the program has.
        steps: systems with other bounds that are solved at most.
        x, y, z: results, as in `QPSolution`.
    """
    solver, soft = program.solver, program.counts[COUNT.cost]
    base, bounds = soft + program.counts[COUNT.hard], (start, len(solver.give))
    size, took = settle(solver, base, bounds, program.numbers[NUMBER.tolerance], steps, x)
    if size >= 0:
        place_multipliers(solver, base, soft, size, y, z)
    return size, took


@compiled
def guess(program: ProgramMemory, block: OutRow) -> int:
    """Solve from the rows that bound the last solution, without torque limits, and write torques.

    What efforts cost depends on the directions of the gears: those of the solution are taken.

    Args:
        program: PROGRAM.
        block: results.

    Returns:
        UNSOLVED, LIMITED_TORQUE or DONE.
    """
    slopes, ends, positive = program.gears.slopes, program.ends, program.positive
    rows = view(block, ends[PART.by_gear], len(GEAR), len(positive))
    output, share = rows[GEAR.output], rows[GEAR.share]
    x = block[ends[PART.x] : ends[PART.x + 1]]
    y, z = block[ends[PART.y] : ends[PART.y + 1]], block[ends[PART.z] : ends[PART.z + 1]]
    for i in range(len(positive)):
        positive[i] = 1 if program.output[i] > 0.0 else 0
    size, turned, tries = -1, True, 0
    while turned and tries < GUESSES:
        turned, tries = False, tries + 1
        place_efforts(program, positive)
        size = try_bounds(program, 2 * len(program.limited), STEPS, x, y, z)[0]
        if size < 0 or len(program.efforts) == 0:
            break
        place_output(program, x, output, share)
        for i in range(len(positive)):
            differs = (output[i] > 0.0) != (positive[i] != 0) and slopes[0, i] != slopes[1, i]
            if differs and abs(output[i]) > SMALL:
                positive[i], turned = 1 - positive[i], True
    if size < 0 or turned:
        return UNSOLVED
    return DONE if place_torques(program, block) else LIMITED_TORQUE


@compiled(counted=False)
def weigh(
    program: ProgramMemory,
    x: Row,
    choice: Places,
    output: OutRow,
    share: OutRow,
    beyond: OutFlags,
) -> tuple[float, bool]:
    """Write T of x (n,), what the rotors take, and which gears the mesh law takes beyond limits.

    Args:
        program: PROGRAM.
        x: (n,).
        choice: directions (m,) of the program; gears that are decided are not beyond.
        output, share, beyond: results (m,).

    Returns:
        the cost of x, where what must be kept costs nothing, and whether any gear is beyond.
    """
    gears, solver, counts, cost, some = program.gears, program.solver, program.counts, 0.0, False
    place_output(program, x, output, share)
    for i in range(len(choice)):
        torque = gears.slopes[1 if output[i] > 0.0 else 0, i] * output[i] + share[i]
        slack = 1e-5 * (1.0 + abs(torque))
        beyond[i] = torque < gears.lower[i] - slack or torque > gears.upper[i] + slack
        beyond[i] = beyond[i] and choice[i] == 0
        some = some or beyond[i]
    for j in range(len(x)):
        cost += (0.5 * solver.diagonal[j] * x[j] - solver.pull[j]) * x[j]
    for i in range(counts[COUNT.cost]):
        miss = dot(solver.rows[i], x) - solver.right[i]
        cost += 0.5 * miss * miss / solver.softness[i]
    return cost, some


@compiled
def take_pushing(z: Row, wanted: Places, least: float, taken: OutPlaces) -> None:
    """Write which bounds (r,) push with more than `least`, and on which side; and those wanted."""
    for i in range(len(taken)):
        taken[i] = wanted[i] if abs(z[i]) <= least else 1 if z[i] > 0.0 else -1


@compiled
def follow(program: ProgramMemory, output: Row, choice: OutPlaces) -> bool:
    """Give gears that are limited and not decided the direction of T (m,); return if any is."""
    some = False
    for gear in program.limited:
        if choice[gear] == 0:
            choice[gear], some = 1 if output[gear] > 0.0 else -1, True
    return some


@compiled
def contested(
    program: ProgramMemory, z: Row, choice: Places, decided: Places, sides: OutPlaces
) -> int:
    """Write the directions (m,) of gears whose half-space binds, 0 elsewhere; return how many.

    With those directions a solution with multipliers z is the best, whatever the others are.

    Args:
        program: PROGRAM.
        z: multipliers (r,) of the bounds.
        choice, decided: directions (m,) of the program, and those that are not to be revised.
        sides: result.
    """
    count, found = len(program.limited), 0
    sides[:] = 0
    for i in range(count):
        gear = program.limited[i]
        steeper = program.gears.slopes[1, gear] - program.gears.slopes[0, gear]
        if choice[gear] == 0 or decided[gear] != 0 or steeper == 0.0:
            continue
        push = z[i + count if choice[gear] > 0 else i]
        if (-push if steeper > 0.0 else push) > _ACTIVE:
            sides[gear], found = choice[gear], found + 1
    return found


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
        rounds, iterations: programs solved, and their work, since `start`.
    """

    def __init__(self, program: Program, guesses: bool) -> None:
        """Take a program.

        Args:
            program: the program.
            guesses: whether the rows that bound the last solution are tried before the solvers.
        """
        settings, m = program.recipe.settings, program.memory.gears.driven.shape[0]
        self._program, self._guesses = program, guesses
        self._solver, self._tolerance = settings.solver, settings.tolerance
        self._most, self._gives = settings.max_iterations, False
        self._least = 10.0 * settings.tolerance  # push from which a bound binds
        self.output, self._beyond, self._sides = np.empty(m), np.empty(m, bool), np.empty(m, int)
        self._written = self.output, np.empty(m), self._beyond
        self._limits = program.joint.start < program.bounds
        self._regular = settings.force_weight > 0.0
        self._passing: FloatArray | None = None
        self._daqp = Daqp()

    def start(self, passing: FloatArray | None) -> None:
        """Count anew; bounds let pass x (n,) of the level above, None where there is none."""
        self._passing, self._gives = passing, passing is None and self._limits
        self.rounds, self.iterations, self._spent = 0, 0, 0.0

    def place(self, decided: IntArray, output: FloatArray) -> None:
        """Write the rows of torque limits where some gears are decided, and those of efforts."""
        program, memory = self._program, self._program.memory
        place_torque_limits(memory, decided)
        if program.has_efforts:
            place_efforts(memory, (output > 0.0).astype(np.int_))
        if self._passing is not None:
            slack = REACH * memory.numbers[NUMBER.tolerance]
            let_pass(memory, program.lock, self._passing, slack, 0, program.torque.stop)

    def _may_begin(self, most: float) -> bool:
        """Whether another program may be begun."""
        return self.rounds == 0 or self.iterations + _PROGRAM + _GUESS < most

    def solve(self, output: FloatArray, decided: IntArray) -> DirectedSolution:
        """Return the best solution over all directions, or the best within the work.

        Args:
            output: T (m,) whose signs the efforts begin with, and the directions.
            decided: (m,) 1 or -1 for the sign of T of gears that are decided, else 0.
        """
        slopes = self._program.memory.gears.slopes
        for _ in range(GUESSES):
            found = self._branch(output, decided)
            more = self._program.has_efforts and self._may_begin(self._most)
            if not (more and found.settled):
                break
            differs = ((self.output > 0.0) != (output > 0.0)) & (slopes[0] != slopes[1])
            if not (differs & (np.abs(self.output) > SMALL)).any():
                break
            output = self.output.copy()
        return found

    def _branch(self, output: FloatArray, decided: IntArray) -> DirectedSolution:
        """Return the solution of least cost with the efforts of some torques (m,)."""
        memory, most, lowest = self._program.memory, 1.0 * self._most, np.inf
        taken, sides, start = memory.solver.taken, self._sides, memory.solver.taken.copy()
        guess, nodes = decided.copy(), [(-np.inf, decided, start)]
        if follow(memory, output, guess):
            nodes.append((-np.inf, guess, start))
        best: tuple[QPSolution, IntArray] | None = None
        relaxed, refused = NOTHING, (NOTHING, decided)
        while nodes and self._may_begin(most):
            if best is not None:  # the least bound first; before, the last one is the deepest
                nodes.sort(key=lambda entry: -entry[0])
            bound, node, taken[:] = nodes.pop()
            if bound >= lowest:
                break
            self.place(node, output)
            solution = self._solved()
            if solution.status is not QPStatus.SOLVED:
                refused = (solution, node) if refused[0] is NOTHING else refused
                if self._gives:  # limits give way before directions are searched
                    nodes = []
                continue
            cost, some_beyond = weigh(memory, solution.x, node, *self._written)
            if cost >= lowest:
                continue
            if some_beyond:
                signs, start = np.where(self.output > 0.0, 1, -1), taken.copy()
                nodes += _turned(node, signs * self._beyond, cost, start)
                nodes.append((cost, np.where(self._beyond, signs, node), start))
                relaxed = solution
                continue
            if node is guess or best is None:
                nodes = []
                if contested(memory, solution.z, node, decided, sides):
                    nodes = _turned(decided, sides, -np.inf, taken.copy())
                    wrong = (sides != 0) & ((self.output > 0.0) != (sides > 0))
                    if wrong.any():
                        guess = np.where(wrong, -sides, node)
                        nodes.append((-np.inf, guess, taken.copy()))
            best, lowest, most = (solution, node), cost, _SEARCHED * self._most
        if best is not None:
            return self._found(*best, settled=True)
        # where the work ends, torques that have to be clipped are better than nothing
        if relaxed is NOTHING or not nodes:
            return self._found(*refused, settled=False)
        return self._found(relaxed, refused[1], settled=False)

    def _found(self, solution: QPSolution, decided: IntArray, *, settled: bool) -> DirectedSolution:
        if solution.status is QPStatus.SOLVED:
            weigh(self._program.memory, solution.x, decided, *self._written)
        took = self.rounds, self.iterations, self._spent
        return DirectedSolution(solution, decided, settled, *took)

    def _solved(self) -> QPSolution:
        """Return the solution of the program as it stands, or one that is not SOLVED.

        From bounds that bound another solution, where there are some; else by a solver.
        """
        start, found, solver = perf_counter(), NOTHING, self._program.memory.solver
        self.rounds += 1
        if self._guesses and keep_hopeful(solver, self._tolerance):
            found = self._guessed(FEW)
        if found is NOTHING and (self._solver == "proxqp" or not self._guesses):
            self.iterations += _PROGRAM
            most, problem = max(self._most - self.iterations - _GUESS, 1), self._program.dense()
            found = solve(self._solver, problem, tolerance=self._tolerance, most=most)
            self.iterations += found.iterations
            if found.status is QPStatus.SOLVED and self._guesses:
                found = self._refined(found)
        # alone ProxQP calls programs infeasible that leave hardly any room
        unsolved = found.status is not QPStatus.SOLVED
        if unsolved and (found is NOTHING or self._may_begin(self._most)):
            found = self._in_turn()
        self._spent += perf_counter() - start
        return found

    def _in_turn(self) -> QPSolution:
        """Return the solution by daqp, or where limits give way the motion that comes nearest.

        The bounds that bind are found with even costs, and limits that ask for motion as tasks: at
        first without limits of joints and distances, then with all. The costs as they are begin
        with these. Where not all can be kept, or the work ends, the first motion is the answer,
        beside the limits that ask for none where few steps lead there, else with a price on all.
        """
        program, solver, wanted = self._program, self._program.memory.solver, self._program.wanted
        self.iterations += _PROGRAM
        costs = solver.diagonal.copy(), solver.pull.copy()
        place_prices(program.memory, wanted)
        try:
            H, g, rows, lower, upper = program.written()
            bounds = [(lower[i], upper[i]) for i in ((0, 1) if self._limits else (1,))]
            # each may take one iteration more than it is allowed
            most = self._most - self.iterations - _GUESS - len(bounds)
            asked = H, g, rows, bounds, len(rows) - program.bounds
            found = self._daqp.solve(*asked, tolerance=self._tolerance, most=most)
            self.iterations += sum(one.iterations for one in found)
            last = found.pop()
            if last.status is not QPStatus.SOLVED:
                if not (self._gives and found):
                    return last
                known, give = last.status is QPStatus.INFEASIBLE, solver.give.copy()
                solver.give[wanted == 0] = 0.0  # limits that ask for no motion may be kept
                eased = self._refined(found[-1], FEW)
                if eased is found[-1] and self._may_begin(self._most + _PROGRAM):
                    solver.give[:] = give
                    eased = self._refined(eased)
                return eased._replace(status=QPStatus.EASED if known else QPStatus.UNFINISHED)
        finally:
            solver.diagonal[:], solver.pull[:] = costs
            solver.give[:], wanted[:] = 0.0, 0
        exact = self._refined(last)
        return last._replace(status=QPStatus.UNFINISHED) if exact is last else exact

    def _refined(self, found: QPSolution, steps: int = 3 * STEPS) -> QPSolution:
        """Return the solution from the bounds that push in one, to the last digits if possible.

        With 1, 2 and 3 times STEPS it is found in 251, 294 and 299 of 300 ticks of Talos with
        3 rad/s of noise.
        """
        solver = self._program.memory.solver
        if not self._regular:  # then the small system is none
            return found
        take_pushing(found.z, self._program.wanted, self._least, solver.taken)
        exact = self._guessed(min((self._most - self.iterations) // _STEP, steps))
        return found if exact is NOTHING else exact

    def _guessed(self, steps: int) -> QPSolution:
        """Return the solution from the rows taken as binding, NOTHING where they lead to none."""
        program, hard = self._program, int(self._program.memory.counts[COUNT.hard])
        x, y, z = np.empty(program.n), np.empty(hard), np.empty(program.bounds)
        size, took = try_bounds(program.memory, 0, steps, x, y, z)
        self.iterations += max(_GUESS, _STEP * took)
        return NOTHING if size < 0 else QPSolution(x, y, z, QPStatus.SOLVED, 0)


def _turned(node: IntArray, sides: IntArray, cost: float, taken: IntArray) -> list[_Node]:
    """Return the parts of a node in which at least one gear is on another side than these."""
    found, own = list[_Node](), node.copy()
    for gear in np.flatnonzero(sides):
        other = own.copy()
        other[gear] = -sides[gear]
        found.append((cost, other, taken))
        own[gear] = sides[gear]
    return found
