"""One level of priority for one set of contacts: its program, solved."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.control.command import Refused, Status, consistent
from wbc.control.inputs import Complaint
from wbc.control.memory import COUNT, GEAR, NUMBER, PART
from wbc.control.qp.lock_rows import extend_by_bounds, hold, place_above, place_lock
from wbc.control.qp.program import REACH, Program, Recipe
from wbc.control.qp.search import NOTHING, SOLVED, DirectedSolution, DirectionSearch
from wbc.control.qp.solvers import QPProblem, QPSolution, QPStatus, WarmStart
from wbc.control.rows.contacts import BoundContact, ContactRanks, ContactSet
from wbc.control.rows.schedule import ContactRamp

_BINDS = 1e-6
_FEW = 4
_ROWS = {
    "output_torque": GEAR.output,
    "mesh_torque": GEAR.mesh,
    "expected_speed": GEAR.turning,
    "certainty": GEAR.sigma,
}


class Answer(NamedTuple):
    """What a level came to, and where it is usable the torques of that: fields of `Command`.

    Attributes:
        level: that was asked.
        block: results, as `Program.at` says.
        dt: time until the next tick [s].
        found: how it was found; its solution is in the block where no search was needed.
        hard: how many hard rows the program has.
    """

    level: Level
    block: FloatArray
    dt: float
    found: DirectedSolution
    hard: int = 0

    @property
    def usable(self) -> bool:
        """Whether there are torques."""
        return self.found.verdict[0].usable

    def row(self, number: int) -> FloatArray:
        """Return one of the rows of the gears (m,), see `wbc.control.tick`."""
        return self.block[self.level.program.rows[number]]

    @property
    def refused(self) -> Refused | None:
        """The program, None where it has a solution or the solver was not asked."""
        program, asked = self.level.program, self.found.solution is not NOTHING
        return Refused(program.dense(), program) if asked and not self.usable else None

    def followed_by(self, deeper: Answer) -> Answer:
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
        x: FloatArray = self.block[self.level.program.at[PART.x]]
        return x[: self.level.program.nv]

    def field(self, name: str) -> Any:
        """Return a field of `Command`."""
        if name in _ROWS:
            return self.row(_ROWS[name])
        return getattr(self if name in vars(Answer) else self.found, name)

    @property
    def consistent(self) -> bool:
        """Whether the mesh law allows the torques."""
        gears = self.level.program.memory.gears
        output, mesh, sigma = self.row(GEAR.output), self.row(GEAR.mesh), self.row(GEAR.sigma)
        return consistent(output, mesh, sigma, gears.forward, gears.backward)

    @property
    def forces(self) -> Mapping[str, FloatArray]:
        """The force of every active contact."""
        program = self.level.program
        x = self.block[program.at[PART.x]]
        return program.contacts.wrenches(program.force_scale * x[program.nv :])

    @property
    def velocity(self) -> FloatArray:
        """Velocity of the driven joints (m,) after the time step."""
        driven, now = self.level.program.recipe.robot.actuated, self.level.program.at[PART.velocity]
        return np.asarray(self.block[now][driven] + self.dt * self.acceleration[driven])

    @property
    def position(self) -> FloatArray:
        """Position of the driven joints (m,) after the time step."""
        robot, at = self.level.program.recipe.robot, self.level.program.at
        rate = 0.5 * (self.block[at[PART.velocity]][robot.actuated] + self.velocity)
        return np.asarray(self.block[at[PART.position]][robot.actuated_position] + self.dt * rate)

    @property
    def solution(self) -> QPSolution:
        """The solution of the last program."""
        if self.found.solution is not NOTHING:
            return self.found.solution
        x, z, y = (self.block[self.level.program.at[part]] for part in (PART.x, PART.z, PART.y))
        return QPSolution(x, y[: self.hard], z, QPStatus.SOLVED, 0)


class Level:
    """Solves one level's program of one set of contacts.

    Attributes:
        program: of the level.
        guesses: whether a solution without torque limits is worth a try.
        unsearched: what a guess comes to, in no time.
    """

    def __init__(self, program: Program, rank: int) -> None:
        """Take the program of the level of a rank, below `rank` more important ones."""
        settings, stacks = program.recipe.settings, program.recipe.stacks
        self.program, self._above = program, [stack.memory for stack in stacks[:rank]]
        # a program whose diagonal has zeros is none for the guess
        self._may_guess = (
            settings.warm_start is WarmStart.ACTIVE_SET and settings.force_weight > 0.0
        )
        self._search = DirectionSearch(program, self._may_guess)
        self._passing = np.zeros(0)
        undecided: IntArray = np.zeros(len(self._search.output), dtype=np.int_)
        self.unsearched = DirectedSolution(NOTHING, undecided, True, 1, 0, 0.0)
        self.forget()

    def forget(self) -> None:
        """Start the next tick without the rows that bound the last one."""
        self.guesses = self._may_guess
        self.program.memory.solver.taken[:] = 0

    def take(self, ceilings: Mapping[str, float]) -> None:
        """Begin a tick with the greatest normal force [N] of each active contact."""
        self.program.take(ceilings)
        self.program.memory.counts[COUNT.hard] = self.program.unlocked

    def hold(self, above: Answer) -> int:
        """Hold what the level above has decided, with the rows of torque limits that bound it.

        Returns:
            how many freedoms are left.
        """
        program, memory, lock, start = self.program, self.program.memory, self.program.lock, 0
        for tasks in self._above:
            start = place_above(tasks, lock.above, start)
        x = self._passing = above.block[above.level.program.at[PART.x]]
        # a guess leaves torque limits out
        limited = bool(above.found.solution.z[program.torque].any())
        if limited:
            self._search.start(None)
            self._search.place(above.found.decided, above.row(GEAR.output))
        reach = REACH * memory.numbers[NUMBER.tolerance]
        left = int(hold(memory, lock, x, limited, program.unlocked, reach))
        if left < 0:
            extend_by_bounds(lock)
            left = int(place_lock(memory, lock, x, len(x), program.unlocked, reach))
        return left

    def search(self, above: Answer | None, last: FloatArray) -> DirectedSolution:
        """Return the solution of the program with torque limits.

        Args:
            above: what is decided already.
            last: block whose torques the directions begin with where nothing is.
        """
        program, passing, decided = self.program, None, self.unsearched.decided
        output = last[program.rows[GEAR.output]].copy()
        if above is not None:
            output, passing, decided = above.row(GEAR.output), self._passing, above.found.decided
        self._search.start(passing)
        found, excess = self._search.solve(output, decided), None
        if found.solution.status in (QPStatus.EASED, QPStatus.UNFINISHED):
            excess = program.excess(found.solution)
        verdict = _judged(found, program)
        if verdict[0].usable:
            torques = found.solution.z[program.torque]
            self.guesses = self._may_guess and not (np.abs(torques) > _BINDS).any()
        else:
            self._search.place(found.decided, output)
        return found._replace(verdict=verdict, excess=excess)

    def expecting(self, last: FloatArray) -> FloatArray:
        """Return the block of the last tick for the next one, after this one had no solution.

        It expects the speed that was expected of this tick, drawn towards the measured one.
        """
        last = last.copy()
        last[self.program.at[PART.advanced]] = self.program.memory.corrected
        return last

    def built(self, last: FloatArray, decided: IntArray) -> QPProblem:
        """Return a copy of the program of the last tick.

        Args:
            last: block whose torques the efforts go by.
            decided: directions of gears (m,).
        """
        passing = None if self.program.lock is None else self._passing
        self._search.start(passing)
        self._search.place(decided, last[self.program.rows[GEAR.output]])
        return self.program.dense()


def _judged(found: DirectedSolution, program: Program) -> Complaint:
    """Return how usable a solution is, and what is in its way."""
    solution = found.solution
    finite = bool(np.isfinite(solution.x).all()) and len(solution.x) == program.n
    if solution.status in (QPStatus.SOLVED, QPStatus.EASED, QPStatus.UNFINISHED):
        if not finite:
            return Status.FAILED, "the solver returned values that are not finite."
        if solution.status is QPStatus.UNFINISHED:
            return Status.INACCURATE, f"no better motion within {found.iterations} units of work."
        if found.settled or solution.status is QPStatus.EASED:
            return SOLVED
        return Status.INACCURATE, "directions of power not settled; torques clipped."
    if solution.status is QPStatus.INFEASIBLE:
        # the last point of daqp keeps all but what it could not add
        beyond = program.excess(solution)[0, : program.joint.start] if finite else np.zeros(1)
        broken = program.labels[int(np.argmax(beyond))][0] if beyond.any() else "a constraint"
        return Status.INFEASIBLE, f"{broken} cannot be kept beside the others; see explain()."
    return Status.FAILED, f"no solution within {found.iterations} units of work; see explain()."


class Levels:
    """The levels of all sets of contacts, each with a warm start of its own.

    With up to four contacts those of all sets are made at once, so that no tick has to: one takes
    as long as ten ticks.

    Attributes:
        shared: size of the part of a block of results that all programs have, see `PART`.
    """

    def __init__(self, recipe: Recipe, contacts: Mapping[str, BoundContact]) -> None:
        """Remember what programs are made of."""
        self._recipe, self._contacts, self._all = recipe, dict(contacts), tuple(contacts)
        model, m = recipe.robot.model, recipe.robot.transmission.size
        self.shared = model.nq + 3 * model.nv + len(GEAR) * m
        self._ranks = ContactRanks(recipe.robot, recipe.kinematics, contacts)
        self._made: dict[tuple[str, ...], tuple[Level, ...]] = {}
        self._ramp: ContactRamp | None = None
        if self._all and (down := recipe.settings.contact_ramp) > 0.0:
            self._ramp = ContactRamp(self._all, recipe.load, down, rise=0.5 * down)
        self._fresh, self._settled = True, False
        self._wanted: dict[str, float] | None = None
        self._last: tuple[tuple[Level, ...], Mapping[str, float]] = (), {}
        if len(self._all) <= _FEW:
            for count in range(len(self._all) + 1):
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
        asked = dict.fromkeys(names, np.inf) if wanted is None else wanted
        asked = {name: asked[name] for name in names if asked.get(name, 0.0) > 0.0}
        ceilings: Mapping[str, float] = asked
        if ramp is not None:
            ceilings = ramp.step(asked, dt, at_once=self._fresh)
        self._fresh, self._settled = False, ceilings == asked
        self._wanted = None if wanted is None else dict(wanted)
        self._last = self._of(tuple(ceilings)), ceilings
        return self._last

    def _of(self, names: tuple[str, ...]) -> tuple[Level, ...]:
        """Return the levels for some contacts, in the order of all."""
        levels = self._made.get(names)
        if levels is None:
            recipe, chosen = self._recipe, [self._contacts[name] for name in names]
            contacts = ContactSet(tuple(chosen), recipe.kinematics.model, self._ranks.rank(names))
            ranks = range(len(recipe.stacks))
            levels = tuple(Level(Program(recipe, contacts, rank), rank) for rank in ranks)
            self._made[names] = levels
        return levels
