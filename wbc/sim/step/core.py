"""A plant's constant numbers and memory as plain arrays, and the parts of a step on them."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.effects.tables import EffectTable
from wbc.errors import SimulationError
from wbc.mechanics.newton import UNSOLVED, WAYS
from wbc.mechanics.rows import RowSystem
from wbc.mechanics.tree import Tree
from wbc.robot import Robot
from wbc.sim.barriers import TOUCH, Barriers
from wbc.sim.ground import Terrain
from wbc.sim.state import SimState
from wbc.sim.step.arrival import DRIFT, lift
from wbc.sim.step.contacts import FIELD
from wbc.sim.step.field import AHEAD
from wbc.sim.step.flanks import grip_laws
from wbc.sim.step.forces import EffectForces
from wbc.sim.step.gears import Drivetrain
from wbc.sim.step.impact import (
    CONTACT,
    ENERGY,
    HIT,
    ROWS_OF,
    SHARE,
    USED,
    WAY,
    gaps_of,
    impact_at,
    impact_in_rows,
)
from wbc.sim.step.motion import free_bases, to_middle
from wbc.sim.step.part import LANDED, part_in_rows, part_of_step, second_half
from wbc.sim.step.part_rows import PartRows
from wbc.sim.step.program import (
    TOLERANCE,
    StepProgram,
    StepSolution,
    blown_up,
    solve_rows,
    tolerance_of,
    unsolved,
)
from wbc.sim.step.solution import NEVER, NO_INERTIA, UNDECIDED, couple
from wbc.sim.step.tables import Ending, Obstacles, opened

_NOTHING = np.zeros(0)
_ROUNDING = 1e-9
_TRIES = 5
"""Shares of the restitution tried between none and all; the loss is quadratic in the share while
rows keep to their pieces, so that false position meets it soon."""
_Answer = ctypes.CFUNCTYPE(None)


def _cut(place: int) -> FloatArray:
    """Return the property that is one of the slices of `Ended`."""
    found: Any = property(lambda ended: ended._out[ended._cuts[place]])
    return found  # type: ignore[no-any-return]


class Ended:
    """Where a part ended: a copy of `Ending`, cut into its arrays when asked for.

    Attributes:
        closed: (2 j + c,) barriers that stay closed.
        landed: whether a barrier that is not closed is passed.
        left: whether some overlap is left to take back.
        given: whether Python solved the rows, range by range of self-locking gears.
    """

    __slots__ = ("_cuts", "_out", "closed", "given", "landed", "left")

    def __init__(
        self, out: FloatArray, cuts: tuple[slice, ...], closed: BoolArray, result: int
    ) -> None:
        """Keep a copy of what `part_of_step` wrote, and where it is cut."""
        self._out, self._cuts, self.closed = out, cuts, closed
        self.landed, self.left, self.given = abs(result) == LANDED, result < 0, False

    position, velocity, motor_speed, impulse, gap = map(_cut, range(5))
    after, mesh_impulse, depth, pushes, deflection = map(_cut, range(5, 10))
    books, work, before, speed = map(_cut, range(10, 14))
    force = _cut(15)


class Struck(NamedTuple):
    """What barriers that are reached do.

    Attributes:
        kind: APART, RESTING or HIT.
        fresh, closed: (2 j + c,) barriers that are reached, and that are closed afterwards.
        after: v (nv,) after; this and the rest belong to HIT.
        contact_impulse: (k, 3) [N s] on the robot, world axes.
        impulse: (r,) of the rows.
        aims: (l + k,) speeds at which they part.
        found: numbers MESH to LEFT of `impact`.
    """

    kind: int
    fresh: BoolArray
    closed: BoolArray
    after: FloatArray
    contact_impulse: FloatArray
    impulse: FloatArray
    aims: FloatArray
    found: FloatArray


def _padded(rows: list[FloatArray]) -> FloatArray:
    """Return rows of numbers as one array, with zeros behind the shorter ones."""
    found = np.zeros((len(rows), max(map(len, rows), default=0)))
    for own, row in zip(found, rows, strict=True):
        own[: len(row)] = row
    return found


class Core:
    """The compiled work of one plant, with the memory that it works in.

    Attributes:
        plant: its numbers and memory, which Python reads and writes between the loops, too.
    """

    def __init__(
        self,
        robot: Robot,
        terrain: Terrain,
        tree: Tree,
        drive: Drivetrain,
        barriers: Barriers,
        return_speed: float,
        compliance: tuple[float, float],
        laws: EffectTable | None,
    ) -> None:
        """Keep what does not change and make room for the rest; loops evaluate `laws`."""
        bases = free_bases(robot)
        nq, nv, m = robot.model.nq, robot.model.nv, drive.size
        points, size, tangents = barriers.points, barriers.size, 1 if barriers.planar else 2
        self._names, self._terrain = robot.transmission.joints, terrain
        self._error: BaseException | None = None
        solids = [solid.numbers() for solid in terrain.solids]
        known = [numbers for numbers in solids if numbers is not None]
        asked = 0
        if len(known) < len(solids):
            self._answer = _Answer(self._ask_ground)
            asked = int(ctypes.cast(self._answer, ctypes.c_void_p).value or 0)
        obstacles = Obstacles(
            *barriers.tables(tree),
            _padded(known),
            np.zeros((points, 3)),
            np.full(nq, np.nan),
            np.zeros((barriers.contacts, 7)),
            tangents,
            any(numbers[0] == FIELD for numbers in known) and asked == 0,
            asked,
        )
        stored = m + nv + size + tangents * barriers.contacts
        pushes = 3 * (points + len(barriers.pairs))
        sizes = nq, nv, m, stored, size, nv, m, size, pushes, m, 11, 2, nq, nv, size, nv, nv, nq
        ends = np.cumsum(sizes).tolist()
        self._cuts = tuple(map(slice, [0, *ends], ends))
        self._out, self._size = np.zeros(ends[-1]), size
        slices = (self._out[cut] for cut in self._cuts)
        ending = dict(zip(Ending._fields, slices, strict=False))
        ending["closed"] = np.zeros(size, dtype=np.bool_)
        hit = {
            "after": np.zeros(nv),
            "pushes": np.zeros(pushes),
            "impulse": np.zeros(m + size * (1 + tangents)),
            "aims": np.zeros(size),
            "found": np.zeros(8),
            "fresh": np.zeros(size, dtype=np.bool_),
            "closed": np.zeros(size, dtype=np.bool_),
        }
        bounds = return_speed, TOLERANCE, DRIFT, TOUCH, *compliance, AHEAD
        gears = drive.tables(robot.rotors_turn_with_links)
        self.tree = tree
        self.plant = opened(
            tree, bases, obstacles, gears, barriers.bodies, bounds, laws, ending, hit
        )
        self._loose, self._drive, self._pushed = drive.any_loose, drive, False

    def _ask_ground(self) -> None:
        """Fill gaps and normals of ground that only Python knows."""
        told = self.plant.obstacles
        count = len(told.points)
        try:
            for number, solid in enumerate(self._terrain.solids):
                own = slice(number * count, (number + 1) * count)
                told.touch[own, 0], told.touch[own, 1:4] = solid.gap(told.points)
        except BaseException as error:
            self._error, told.touch[:] = error, np.nan

    def _heard(self) -> None:
        """Raise what the ground raised."""
        error, self._error = self._error, None
        if error is not None:
            raise error

    def tell_motion(self, state: SimState) -> None:
        """Give the loops the motion of loose motor outputs."""
        if self._loose:
            deflection, speed = self._drive.motion(state)
            self.plant.gears.motion[:, 0], self.plant.gears.motion[:, 1] = deflection, speed

    def to_middle(self, state: SimState, half: float) -> tuple[FloatArray, FloatArray]:
        """Return q (nq,) and v (nv,) in the middle of a part, after `half` a step [s].

        The memory then stands there.
        """
        q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
        to_middle(self.plant, q, v, half, state.closed)
        return self.plant.end.middle.copy(), self.plant.end.speed.copy()

    def part(
        self,
        state: SimState,
        begun: bool,
        forces: EffectForces,
        external: FloatArray | None,
        kept: BoolArray,
        step: float,
    ) -> Ended:
        """Return the end of a part.

        Args:
            state: at its start.
            begun: whether the memory stands in the middle already.
            forces: of the effects there.
            external: (nv,), None for none.
            kept: (2 j + c,) barriers that may close within the part.
            step: h [s].

        Raises:
            SimulationError: the part has no solution, or several.
        """
        self.tell_motion(state)
        self._tell_forces(forces, external)
        before, v = (state.closed, kept, state.impulse), np.ascontiguousarray(state.velocity)
        given = _NOTHING
        if begun:
            result = second_half(self.plant, *before, given, v, step)
        else:
            q = np.ascontiguousarray(state.position)
            result = part_of_step(self.plant, *before, q, v, step)
        if result == 10 + UNDECIDED:
            _, system, start, _ = self._in_rows(state, kept, step)
            given, _, _ = solve_rows(system, start, self._names)
            result = second_half(self.plant, *before, given, v, step)
        if self._error is not None:
            self._heard()
        ended = Ended(self._out.copy(), self._cuts, self.plant.end.closed.copy(), result)
        ended.given = len(given) > 0
        if result >= 10:
            raise self._failure(result - 10, state, kept, step, ended)
        return ended

    def _tell_forces(self, forces: EffectForces, external: FloatArray | None) -> None:
        """Give the loops what acts, beside what stays and what they evaluate."""
        told = self.plant.forces
        told.torque[:] = forces.rotor
        if forces.friction is not None:
            told.friction[:] = forces.friction
            told.outer[:] = forces.joint if external is None else forces.joint + external
        elif external is not None or self._pushed:
            told.outer[:] = 0.0 if external is None else external
            self._pushed = external is not None

    def _in_rows(self, state: SimState, kept: BoolArray, step: float) -> Any:
        """Return what `part_in_rows` does; the loops have been told motion and forces."""
        q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
        before = state.closed, kept, state.impulse
        return part_in_rows(self.plant, *before, q, v, step)

    def _failure(
        self, way: int, state: SimState, kept: BoolArray, step: float, ended: Ended
    ) -> SimulationError:
        inertia = self.plant.placed.inertia
        if way == NO_INERTIA or not np.isfinite(inertia).all():
            return blown_up(inertia, state.velocity)
        rows, system, _, _ = self._in_rows(state, kept, step)
        if not np.isfinite(system.free).all():
            return blown_up(inertia, state.velocity)
        return unsolved(system, ended.impulse[rows.places], tolerance_of(system))

    def solution(
        self,
        state: SimState,
        forces: EffectForces,
        external: FloatArray | None,
        kept: BoolArray,
        step: float,
        ended: Ended,
    ) -> StepSolution:
        """Return the program of a part and its solution; arguments as of `part`, and its end."""
        self.tell_motion(state)
        self._tell_forces(forces, external)
        rows, system, _, inertia = self._in_rows(state, kept, step)
        couple(self.plant, rows, system, ended.speed, ended.after, step)
        gears, motor = self.plant.gears, ended.motor_speed
        grip_laws(gears, rows.relative, step, ended.after, motor, system.laws)
        used, way = ended.work.astype(int).tolist()
        method, impulse = "ranges" if ended.given else WAYS[way], ended.impulse[rows.places]
        if len(rows.depths):  # what compliant contacts meet is their aim
            met = slice(len(rows.targets) - len(rows.depths), None)
            normal = slice(len(rows.laws) + met.start, len(rows.laws) + len(rows.targets))
            speed = system.free[normal] + system.delassus[normal] @ impulse
            rows.targets[met] = np.where(impulse[normal] > 0.0, speed, NEVER)
        program = self._program(rows, system, inertia)
        return StepSolution(program, system, ended.after, impulse, used, method)

    def _program(self, rows: PartRows, system: RowSystem, inertia: FloatArray) -> StepProgram:
        given = rows.matrix, system.laws, rows.targets, rows.frictions
        return StepProgram(inertia, rows.free, *given, self.plant.obstacles.tangents)

    def gaps(self, position: FloatArray) -> FloatArray:
        """Return all gaps (2 j + c,) at q (nq,)."""
        gap = np.empty(self._size)
        gaps_of(self.plant, np.ascontiguousarray(position), gap)
        self._heard()
        return gap

    def lift(self, position: FloatArray, stiff: FloatArray) -> tuple[bool, FloatArray, FloatArray]:
        """Return whether the robot can be lifted out, q (nq,) then, and gaps (2 j + c,) before."""
        q, gap = np.array(position), np.empty(self._size)
        done = lift(self.plant, stiff, q, gap)
        self._heard()
        return done, q, gap

    def impact(
        self, state: SimState, closed: BoolArray, kept: BoolArray, back: FloatArray, left: float
    ) -> Struck:
        """Return the impact on barriers that have just been reached.

        Args:
            state: where the robot is.
            closed: (2 j + c,) barriers that are known to be.
            kept: (2 j + c,) barriers that are rows of what is left of the step.
            back: (2 j + c,) restitution.
            left: of the step [s].

        Raises:
            SimulationError: the impact has no solution, or several.
        """
        self.tell_motion(state)
        q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
        hit, found = self.plant.hit, self.plant.hit.found

        def strike(share: float, given: FloatArray = _NOTHING) -> int:
            own = share * back
            kind: int = impact_at(self.plant, closed, kept, own, q, v, left, given)
            found[SHARE] *= share
            return kind

        kind = strike(1.0)
        self._heard()
        together = closed | hit.fresh | kept
        if kind == HIT and found[SHARE] > 0.0 and found[WAY] <= UNSOLVED:
            _give_less_back(strike, found)
        elif kind == HIT and found[WAY] == UNDECIDED:
            for share in (1.0, 0.0):
                strike(share)
                _, system, _ = self._impact_in_rows(state, together, hit.aims, _NOTHING)
                start, m = np.zeros(len(system.free)), len(self._names)
                start[:m] = state.impulse[:m] if len(state.impulse) else 0.0
                given, _, _ = solve_rows(system, start, self._names)
                strike(share, given)
                if found[CONTACT] >= 0.0:
                    break
        if kind == HIT and found[WAY] >= UNSOLVED:
            raise self._impact_failure(int(found[WAY]), state, together)
        return Struck(
            kind,
            hit.fresh.copy(),
            hit.closed.copy(),
            hit.after.copy(),
            hit.pushes.reshape(-1, 3).copy(),
            hit.impulse[: int(found[ROWS_OF])].copy(),
            hit.aims[: int(together.sum())].copy(),
            found.copy(),
        )

    def _impact_failure(self, way: int, state: SimState, together: BoolArray) -> SimulationError:
        inertia, hit = self.plant.placed.inertia, self.plant.hit
        if way == NO_INERTIA or not np.isfinite(inertia).all():
            return blown_up(inertia, state.velocity)
        _, system, _ = self._impact_in_rows(state, together, hit.aims, _NOTHING)
        return unsolved(system, hit.impulse[: int(hit.found[ROWS_OF])], tolerance_of(system))

    def _impact_in_rows(
        self, state: SimState, together: BoolArray, aims: FloatArray, after: FloatArray
    ) -> Any:
        q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
        aims = np.ascontiguousarray(aims[: int(together.sum())])
        return impact_in_rows(self.plant, together, q, v, aims, after)

    def impact_solution(self, state: SimState, together: BoolArray, struck: Struck) -> StepSolution:
        """Return the program of an impact of barriers (2 j + c,) and its solution."""
        self.tell_motion(state)
        rows, system, inertia = self._impact_in_rows(state, together, struck.aims, struck.after)
        used, way, impulse = int(struck.found[USED]), int(struck.found[WAY]), struck.impulse
        program = self._program(rows, system, inertia)
        return StepSolution(program, system, struck.after, impulse, used, WAYS[way])


def _give_less_back(strike: Callable[[float], int], found: FloatArray) -> None:
    """Take the largest share of the restitution at which an impact makes no energy, by a few tries.

    Args:
        strike: takes the impact with a share, and writes `found`.
        found: numbers MESH to LEFT of `impact`, of the whole restitution.
    """

    def passive() -> bool:
        lost, had = found[CONTACT], found[ENERGY]
        return bool(found[WAY] < UNSOLVED and lost >= -_ROUNDING * had)

    if passive():
        return
    used, high, low = found[USED], 1.0, 0.0
    lost_high = found[CONTACT] if found[WAY] < UNSOLVED else np.nan
    strike(0.0)
    used, lost_low = used + found[USED], found[CONTACT]
    for _ in range(_TRIES if found[WAY] < UNSOLVED else 0):
        share = 0.5 * (low + high)
        if lost_high < 0.0:
            share = low + (high - low) * lost_low / (lost_low - lost_high)
            share = min(max(share, low + 0.1 * (high - low)), high - 0.1 * (high - low))
        strike(share)
        used += found[USED]
        if passive():
            low, lost_low = share, found[CONTACT]
        else:
            high, lost_high = share, found[CONTACT] if found[WAY] < UNSOLVED else np.nan
    strike(low)
    found[USED] += used
