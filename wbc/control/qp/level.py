"""One level of priority for one set of contacts: its program, solved; and those of all sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.control.command import Refused, Status, gear_directions
from wbc.control.inputs import TOO_LARGE, Complaint
from wbc.control.memory import COUNT, GEAR, PART
from wbc.control.qp.active_set import FEW, STEPS, keep_hopeful
from wbc.control.qp.lock_rows import extend_by_bounds, hold, let_pass, place_above, place_lock
from wbc.control.qp.program import Program, Recipe, place_prices, written
from wbc.control.qp.search import GUESSES, SMALL, contested, try_bounds, weigh
from wbc.control.qp.solvers import Daqp, QPProblem, QPSolution, QPStatus, WarmStart, solve
from wbc.control.rows.contacts import ContactRamp, ContactSet, drawn_poses
from wbc.control.rows.gear_rows import place_efforts, place_torque_limits

# What it takes to write a program out and to begin it, to try bounds that may bind, and a step of
# that, in iterations of daqp.
_PROGRAM, _GUESS, _STEP = 70, 30, 2
# Share of the work up to which a better solution than the first is looked for. With all of it 12 of
# 155 hostile ticks of Solo12 would move better, and 11 of 77 of Talos, and the 99th percentile of
# Solo12 would be 740 us in place of 450.
_SEARCHED = 0.5
_BINDS = 1e-6

_EMPTY = np.zeros(0)
SOLVED: Complaint = (Status.SOLVED, "")
NOTHING = QPSolution(_EMPTY, _EMPTY, _EMPTY, QPStatus.FAILED, 0)
# A bound of its cost, the directions it decides, and bounds to start from.
_Node = tuple[float, IntArray, IntArray]


class DirectedSolution(NamedTuple):
    """What a search came to.

    Attributes:
        solution: of the last program solved.
        decided: (m,) 1 or -1 for the sign of T where the last program decides it, else 0.
        rounds: programs solved.
        iterations: work of them, as `ControllerSettings.max_iterations` counts it.
        verdict: how usable the solution is, and what is in its way.
        excess: `Program.excess` where limits may be passed, else None.
    """

    solution: QPSolution
    decided: IntArray
    rounds: int
    iterations: int
    verdict: Complaint = SOLVED
    excess: FloatArray | None = None


class LevelAnswer(NamedTuple):
    """What a level came to, and where it is usable the torques of that: fields of `Command`.

    Attributes:
        level: that was asked.
        block: results, as `Program.at` says.
        dt: time until the next tick [s].
        found: how it was found; its solution is in the block where no search was needed.
        solve_time: [s], as in `Command`.
        hard: how many hard rows the program has.
    """

    level: Level
    block: FloatArray
    dt: float
    found: DirectedSolution
    solve_time: float
    hard: int

    @property
    def usable(self) -> bool:
        """Whether there are torques."""
        return self.found.verdict[0].usable

    def part(self, number: int) -> FloatArray:
        """Return one of the parts of the block, see `PART`."""
        return self.block[self.level.program.at[number]]

    def row(self, number: int) -> FloatArray:
        """Return one of the rows of the gears (m,), see `GEAR`."""
        return self.block[self.level.program.rows[number]]

    @property
    def refused(self) -> Refused | None:
        """The program, None where it has a solution."""
        program = self.level.program
        return None if self.usable else Refused(program.dense(), program)

    def followed_by(self, deeper: LevelAnswer) -> LevelAnswer:
        """Return the answer with the next level, which passes what this one has to.

        A level that finds nothing leaves it at those above.
        """
        (status, message), (verdict, excess) = deeper.found.verdict, self.found[-2:]
        if status is Status.NOT_FINITE:
            return deeper
        if not status.usable:
            left = Status.INACCURATE, f"the tasks of a lower level are left out: {message}"
            return self._replace(found=self.found._replace(verdict=left))
        if excess is None and verdict is SOLVED:
            return deeper
        return deeper._replace(found=deeper.found._replace(verdict=verdict, excess=excess))

    def told(self) -> tuple[Mapping[str, float], str]:
        """Return the limits that are passed, by how much, and that in words."""
        excess = self.found.excess
        return ({}, "") if excess is None else self.level.program.told(excess)

    @property
    def passed(self) -> Mapping[str, float]:
        """The limits that are passed, and by how much."""
        return self.told()[0]

    @property
    def message(self) -> str:
        """What is in the way."""
        return f"{self.told()[1]} {self.found.verdict[1]}".strip()

    @property
    def acceleration(self) -> FloatArray:
        """The expected qdd (nv,)."""
        return self.part(PART.x)[: self.level.program.nv]

    def field(self, name: str) -> Any:
        """Return a field of `Command`."""
        if name in GEAR._fields:
            return self.row(getattr(GEAR, name))
        return getattr(self if name in vars(LevelAnswer) else self.found, name)

    @property
    def consistent(self) -> bool:
        """Whether the mesh law allows t and T in the directions that gears turn.

        FORWARD needs t = T/eta_f, BACKWARD t = eta_b T, STUCK t anywhere between the two; all
        within 1e-6 of the largest torque.
        """
        gears, wanted = self.level.program.memory.gears, (GEAR.output_torque, GEAR.mesh_torque)
        output, mesh = map(self.row, wanted)
        turns = gear_directions(output, self.row(GEAR.certainty))
        ends = np.array([gears.forward, gears.backward]) * output
        surely = np.where(turns > 0.0, ends[0], ends[1])
        low, high = (np.where(turns == 0.0, end, surely) for end in (ends.min(0), ends.max(0)))
        slack = 1e-6 * (1.0 + np.abs(output).max(initial=0.0))
        return bool(((low - slack <= mesh) & (mesh <= high + slack)).all())

    @property
    def forces(self) -> Mapping[str, FloatArray]:
        """The force of every active contact."""
        program = self.level.program
        force = program.force_scale * self.part(PART.x)[program.nv :]
        return program.contacts.wrenches(force)

    @property
    def velocity(self) -> FloatArray:
        """Velocity of the driven joints (m,) after the time step."""
        moved = self.part(PART.velocity) + self.dt * self.acceleration
        return np.asarray(moved[self.level.program.recipe.robot.actuated])

    @property
    def position(self) -> FloatArray:
        """Position of the driven joints (m,) after the time step."""
        robot = self.level.program.recipe.robot
        rate = 0.5 * (self.part(PART.velocity)[robot.actuated] + self.velocity)
        return np.asarray(self.part(PART.position)[robot.actuated_position] + self.dt * rate)

    @property
    def solution(self) -> QPSolution:
        """The solution of the last program."""
        if self.found.solution is not NOTHING:
            return self.found.solution
        x, y, z = map(self.part, (PART.x, PART.y, PART.z))
        return QPSolution(x, y[: self.hard], z, QPStatus.SOLVED, 0)


class Level:
    """Solves one level's program of one set of contacts, over all directions that gears can have.

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
        program: of the level.
        guesses: whether a solution without torque limits is worth a try.
        unsearched, too_large: what a guess comes to, and numbers that nothing can be solved with.
        output: T (m,) of the last solution, which the next one overwrites.
        rounds, iterations, spent: programs solved in a tick, their work, and [s] in the solvers.
    """

    def __init__(self, program: Program, rank: int) -> None:
        """Take the program of the level of a rank, below `rank` more important ones."""
        settings, stacks = program.recipe.settings, program.recipe.stacks
        self.program, self._above = program, [stack.memory for stack in stacks[:rank]]
        self._settings, self._most = settings, settings.max_iterations
        self._limits = program.joint.start < program.bounds
        self._gives = self._limits and rank == 0
        self._may_guess = settings.warm_start is WarmStart.ACTIVE_SET
        self._passing: FloatArray | None = None  # x (n,) of the level above
        m = program.recipe.drivetrain.size
        self.output, self._beyond, self._sides = np.empty(m), np.empty(m, bool), np.empty(m, int)
        self._written = self.output, np.empty(m), self._beyond
        self._daqp = Daqp()
        self.unsearched = DirectedSolution(NOTHING, np.zeros(m, np.int_), 1, 0)
        self.too_large = self.unsearched._replace(verdict=TOO_LARGE)
        self.forget()

    def forget(self) -> None:
        """Start the next tick without the rows that bound the last one."""
        self.guesses = self._may_guess
        self.program.memory.solver.taken[:] = 0

    def hold(self, above: LevelAnswer) -> int:
        """Hold what the level above has decided, with the rows of torque limits that bound it.

        Returns:
            how many freedoms are left.
        """
        program, memory, lock, start = self.program, self.program.memory, self.program.lock, 0
        for tasks in self._above:
            start = place_above(tasks, lock.above, start)
        x, self._passing = above.part(PART.x), None
        # a guess leaves torque limits out
        found = above.found.solution
        limited = found is not NOTHING and bool(found.z[program.torque].any())
        if limited:
            self._place(above.found.decided, above.row(GEAR.output_torque))
        self._passing = x
        left = int(hold(memory, lock, x, limited))
        if left < 0:
            extend_by_bounds(lock)
            left = int(place_lock(memory, lock, x, len(x)))
        return left

    def search(self, above: LevelAnswer | None, last: FloatArray) -> DirectedSolution:
        """Return the best solution over all directions, or the best within the work.

        Args:
            above: what is decided already.
            last: block whose torques the directions begin with where nothing is, and the efforts.
        """
        program, slopes = self.program, self.program.memory.gears.slopes
        self.rounds, self.iterations, self.spent = 0, 0, 0.0
        output, decided = last[program.rows[GEAR.output_torque]].copy(), self.unsearched.decided
        if above is not None:
            output, decided = above.row(GEAR.output_torque), above.found.decided
        for _ in range(GUESSES):
            found = self._branch(output, decided)
            settled = found.verdict is SOLVED and found.excess is None
            if not (program.has_efforts and settled and self._may_begin(self._most)):
                break
            differs = ((self.output > 0.0) != (output > 0.0)) & (slopes[0] != slopes[1])
            if not (differs & (np.abs(self.output) > SMALL)).any():
                break
            output = self.output.copy()
        if found.verdict[0].usable:
            torques = found.solution.z[program.torque]
            self.guesses = self._may_guess and not (np.abs(torques) > _BINDS).any()
        else:
            self._place(found.decided, output)
        return found

    def built(self, last: FloatArray, decided: IntArray) -> QPProblem:
        """Return a copy of the program of the last tick.

        Args:
            last: block whose torques the efforts go by.
            decided: directions of gears (m,).
        """
        self._place(decided, last[self.program.rows[GEAR.output_torque]])
        return self.program.dense()

    def _place(self, decided: IntArray, output: FloatArray) -> None:
        """Write the rows of torque limits where some gears are decided, and those of efforts."""
        program, memory = self.program, self.program.memory
        place_torque_limits(memory, decided)
        if program.has_efforts:
            place_efforts(memory, (output > 0.0).astype(np.int_))
        if self._passing is not None:
            let_pass(memory, program.lock, self._passing, 0, program.torque.stop)

    def _may_begin(self, most: float) -> bool:
        """Whether another program may be begun."""
        return self.rounds == 0 or self.iterations + _PROGRAM + _GUESS < most

    def _branch(self, output: FloatArray, decided: IntArray) -> DirectedSolution:
        """Return the solution of least cost with the efforts of some torques (m,)."""
        memory, most, lowest = self.program.memory, 1.0 * self._most, np.inf
        taken, sides, start = memory.solver.taken, self._sides, memory.solver.taken.copy()
        guess, nodes = decided.copy(), [(-np.inf, decided, start)]
        free = memory.limited[decided[memory.limited] == 0]
        if len(free):
            guess[free] = np.where(output[free] > 0.0, 1, -1)
            nodes.append((-np.inf, guess, start))
        best: tuple[QPSolution, IntArray] | None = None
        relaxed, refused = NOTHING, (NOTHING, decided)
        while nodes and self._may_begin(most):
            if best is not None:  # the least bound first; before, the last one is the deepest
                nodes.sort(key=lambda entry: -entry[0])
            bound, node, taken[:] = nodes.pop()
            if bound >= lowest:
                break
            self._place(node, output)
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
                more = self._may_begin(_SEARCHED * self._most)
                if more and contested(memory, solution.z, node, decided, sides):
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
        program, status, excess = self.program, solution.status, None
        if status is QPStatus.SOLVED:
            weigh(program.memory, solution.x, decided, *self._written)
        if status in (QPStatus.EASED, QPStatus.UNFINISHED):
            excess = program.excess(solution)
        took = self.rounds, self.iterations
        return DirectedSolution(solution, decided, *took, self._judged(solution, settled), excess)

    def _judged(self, solution: QPSolution, settled: bool) -> Complaint:
        """Return how usable a solution is, and what is in its way."""
        program, status, work = self.program, solution.status, f"{self.iterations} units of work"
        finite = bool(np.isfinite(solution.x).all()) and len(solution.x) == program.n
        if status in (QPStatus.SOLVED, QPStatus.EASED, QPStatus.UNFINISHED):
            if not finite:
                return Status.FAILED, "the solver returned values that are not finite."
            if status is QPStatus.UNFINISHED:
                return Status.INACCURATE, f"no better motion within {work}."
            if settled or status is QPStatus.EASED:
                return SOLVED
            return Status.INACCURATE, "directions of power not settled; torques clipped."
        if status is QPStatus.INFEASIBLE:
            # the last point of daqp keeps all but what it could not add
            beyond = program.excess(solution)[0, : program.joint.start] if finite else np.zeros(1)
            broken = program.labels[int(np.argmax(beyond))][0] if beyond.any() else "a constraint"
            return Status.INFEASIBLE, f"{broken} cannot be kept beside the others; see explain()."
        return Status.FAILED, f"no solution within {work}; see explain()."

    def _solved(self) -> QPSolution:
        """Return the solution of the program as it stands, or one that is not SOLVED.

        From bounds that bound another solution, where there are some; else by a solver.
        """
        start, found, solver = perf_counter(), NOTHING, self.program.memory.solver
        self.rounds += 1
        if self._may_guess and keep_hopeful(solver):
            found = self._guessed(FEW)
        if found is NOTHING and self._settings.solver == "proxqp":
            self.iterations += _PROGRAM
            most, problem = max(self._most - self.iterations - _GUESS, 1), self.program.dense()
            found = solve("proxqp", problem, tolerance=self._settings.tolerance, most=most)
            self.iterations += found.iterations
            if found.status is QPStatus.SOLVED and self._may_guess:
                found = self._refined(found)
        # alone ProxQP calls programs infeasible that leave hardly any room
        unsolved = found.status is not QPStatus.SOLVED
        if unsolved and (found is NOTHING or self._may_begin(self._most)):
            found = self._in_turn()
        self.spent += perf_counter() - start
        return found

    def _in_turn(self) -> QPSolution:
        """Return the solution by daqp, or where limits give way the motion that comes nearest.

        The bounds that bind are found with even costs, and limits that ask for motion as tasks: at
        first without limits of joints and distances, then with all. The costs as they are begin
        with these. Where not all can be kept, or the work ends, the first motion is the answer,
        beside the limits that ask for none where few steps lead there, else with a price on all.
        """
        program, solver, wanted = self.program, self.program.memory.solver, self.program.wanted
        self.iterations += _PROGRAM
        costs = solver.diagonal.copy(), solver.pull.copy()
        place_prices(program.memory, wanted)
        try:
            H, g, rows, lower, upper = written(program.memory, wanted)
            bounds = [(lower[i], upper[i]) for i in ((0, 1) if self._limits else (1,))]
            # each may take one iteration more than it is allowed
            most = self._most - self.iterations - _GUESS - len(bounds)
            asked = H, g, rows, bounds, len(rows) - program.bounds
            found = self._daqp.solve(*asked, tolerance=self._settings.tolerance, most=most)
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
        solver = self.program.memory.solver
        pushes = np.abs(found.z) > 10.0 * self._settings.tolerance  # else it hardly binds
        wanted = self.program.wanted
        solver.taken[:] = np.where(pushes, np.sign(found.z), wanted)
        exact = self._guessed(min((self._most - self.iterations) // _STEP, steps))
        return found if exact is NOTHING else exact

    def _guessed(self, steps: int) -> QPSolution:
        """Return the solution from the rows taken as binding, NOTHING where they lead to none."""
        program, hard = self.program, int(self.program.memory.counts[COUNT.hard])
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


_FEW = 4
_POSES = 3
# A row that others decide keeps 1e-16 of its length, an independent one 1e-3 at a drawn pose.
_DEPENDENT = 1e-9


class Levels:
    """The levels of all sets of contacts, each with a warm start of its own.

    With up to four contacts those of all sets are made at once, so that no tick has to: one takes
    as long as ten ticks.

    Several points of one rigid body repeat each other, as do the feet of a robot that has few
    joints between them: how many rows of contacts are independent is told at drawn poses.

    Attributes:
        whole: all contacts.
        shared: size of the part of a block of results that all programs have, see `PART`.
    """

    def __init__(self, recipe: Recipe) -> None:
        """Remember what programs are made of."""
        self._recipe, self._all = recipe, tuple(recipe.contacts)
        robot, kinematics = recipe.robot, recipe.kinematics
        nq, nv, m = robot.model.nq, robot.model.nv, robot.transmission.size
        self.shared = nq + 3 * nv + len(GEAR) * m
        self.whole = ContactSet(tuple(recipe.contacts.values()), kinematics.model)
        drawn = np.empty((_POSES, self.whole.rows, nv))
        for q, jacobian in zip(drawn_poses(robot, _POSES), drawn, strict=True):
            kinematics.update(q, np.zeros(nv))
            self.whole.fill(kinematics)
            jacobian[:] = self.whole.memory.rows.jacobian
        lengths = np.linalg.norm(drawn, axis=2, keepdims=True)
        self._drawn = drawn / np.where(lengths > 0.0, lengths, 1.0)
        self._made: dict[tuple[str, ...], tuple[Level, ...]] = {}
        self._ramp: ContactRamp | None = None
        if self._all and (down := recipe.settings.contact_ramp) > 0.0:
            self._ramp = ContactRamp(self._all, recipe.load, down, rise=0.5 * down)
        self._fresh, self._settled = True, False
        self._wanted: dict[str, float] | None = None
        self._last: tuple[tuple[Level, ...], Mapping[str, float]] = (), {}
        for count in range(len(self._all) + 1 if len(self._all) <= _FEW else 0):
            for names in combinations(self._all, count):
                self._of(names)

    def forget(self) -> None:
        """Start the next tick of every contact set from nothing."""
        self._fresh, self._settled = True, False
        for levels in self._made.values():
            for level in levels:
                level.forget()

    def of(
        self, wanted: Mapping[str, float] | None, dt: float
    ) -> tuple[tuple[Level, ...], Mapping[str, float]]:
        """Return the levels for the contacts that may carry force, and their ceilings [N].

        Args:
            wanted: ceilings that are asked for; None for all contacts without any.
            dt: time until the next tick [s].
        """
        if self._settled and wanted == self._wanted:
            return self._last
        ramp, names = self._ramp, self._all
        asked: Mapping[str, float] = dict.fromkeys(names, np.inf)
        if wanted is not None:
            asked = {name: wanted[name] for name in names if wanted.get(name, 0.0) > 0.0}
        ceilings = asked if ramp is None else ramp.step(asked, dt, at_once=self._fresh)
        self._fresh, self._settled = False, ceilings == asked
        self._wanted = None if wanted is None else dict(wanted)
        self._last = self._of(tuple(ceilings)), ceilings
        return self._last

    def _of(self, names: tuple[str, ...]) -> tuple[Level, ...]:
        """Return the levels for some contacts, in the order of all."""
        levels = self._made.get(names)
        if levels is None:
            recipe, chosen = self._recipe, [self._recipe.contacts[name] for name in names]
            contacts = ContactSet(tuple(chosen), recipe.kinematics.model, self._rank(names))
            ranks = range(len(recipe.stacks))
            levels = tuple(Level(Program(recipe, contacts, rank), rank) for rank in ranks)
            self._made[names] = levels
        return levels

    def _rank(self, names: Sequence[str]) -> int:
        """Return the greatest number of independent rows of some contacts."""
        if not names:
            return 0
        slices = dict(zip(self._all, self.whole.slices, strict=True))
        rows = self._drawn[:, np.r_[tuple(slices[name] for name in names)]]
        return int(np.linalg.matrix_rank(rows, tol=_DEPENDENT * np.sqrt(rows[0].size)).max())
