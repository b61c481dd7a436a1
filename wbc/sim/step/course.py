"""The course of one step as Python sees it: smooth parts, and the impacts between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.errors import SimulationError
from wbc.mechanics.newton import WAYS
from wbc.sim.energy import EnergyFlow
from wbc.sim.setup import Setup
from wbc.sim.state import SimState
from wbc.sim.step.books import CONTACT, FRICTION, GEAR, MESH, MISSED, MOTOR, ROTOR
from wbc.sim.step.flanks import grip_laws
from wbc.sim.step.forces import EffectForces
from wbc.sim.step.impacts import Impact, settle
from wbc.sim.step.landing import flow_until
from wbc.sim.step.program import StepProgram, StepSolution, blown_up, tolerance_of, unsolved
from wbc.sim.step.solution import NEVER, NO_INERTIA, couple


def _cut(place: int) -> FloatArray:
    """Return the property that is one of the slices of `Ended`."""
    found: Any = property(lambda ended: ended._out[ended._cuts[place]])
    return found  # type: ignore[no-any-return]


class Ended:
    """Where a part ended: a copy of `Ending`, cut into its arrays when asked for.

    Attributes:
        closed: (2 j + c,) barriers that stay closed.
        left: whether some overlap is left to take back.
    """

    __slots__ = ("_cuts", "_out", "closed", "left")

    def __init__(
        self, out: FloatArray, cuts: tuple[slice, ...], closed: BoolArray, result: int
    ) -> None:
        """Keep a copy of what `part_of_step` wrote, and where it is cut."""
        self._out, self._cuts, self.closed = out, cuts, closed
        self.left = result < 0

    position, velocity, motor_speed, impulse, gap = map(_cut, range(5))
    after, mesh_impulse, depth, pushes, deflection = map(_cut, range(5, 10))
    books, work, before, speed = map(_cut, range(10, 14))
    force = _cut(15)


class PartInput(NamedTuple):
    """What one smooth part starts from.

    Attributes:
        setup: the plant's.
        state: with known `closed`, and with the memory of its effects.
        command: (m,) rotor torque [N m].
        step: h [s].
        external: generalised force (nv,), None for none.
        kept: (2 j + c,) barriers that may close within the part, without a bounce.
    """

    setup: Setup
    state: SimState
    command: FloatArray
    step: float
    external: FloatArray | None
    kept: BoolArray


@dataclass(eq=False)
class Flow:
    """What happened in one smooth part.

    Attributes:
        state: at its end.
        end: gaps, overlaps, impulses, work and losses.
        forces: of the effects.
        given: what it started from.
    """

    state: SimState
    end: Ended
    forces: EffectForces
    given: PartInput

    @property
    def step(self) -> float:
        """h [s]."""
        return self.given.step

    @property
    def missed(self) -> float:
        """Speed [m/s, rad/s] by which a passive end misses the laws, else zero."""
        return float(self.end.books[MISSED])

    @property
    def gap(self) -> FloatArray:
        """(2 j + c,) at its end."""
        return self.end.gap

    @property
    def overlap(self) -> FloatArray:
        """(2 j + c,) depth [m, rad] beyond the plant's return speed; empty where none is left."""
        return self.end.depth if self.end.left else self.end.depth[:0]

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot, world axes."""
        return self.end.pushes.reshape(-1, 3)

    @property
    def mesh_impulse(self) -> FloatArray:
        """T (m,) [N m s]."""
        return self.end.mesh_impulse

    @property
    def rotor_impulse(self) -> FloatArray:
        """Impulse (m,) [N m s] delivered on the rotors."""
        return self.step * self.forces.rotor

    @cached_property
    def solution(self) -> StepSolution:
        """Of the step program, which is put together and solved again."""
        setup, state, _, step, external, kept = self.given
        end, plant = self.end, setup.plant
        if setup.waits:
            setup.tell_coupling(end.before, end.speed)
            setup.tell_losses(end.before, end.speed)
        setup.tell_motion(state)
        setup.tell_forces(self.forces, external)
        rows, system, _, inertia = setup.in_rows(state, kept, step)
        couple(plant, rows, system, end.speed, end.after, step)
        grip_laws(plant.gears, rows.relative, step, end.after, end.motor_speed, system.laws)
        used, way = end.work.astype(int).tolist()
        impulse = end.impulse[rows.places]
        method = "ranges" if used == 0 and len(impulse) else WAYS[way]  # Python solved the rows
        if len(rows.depths):  # what compliant contacts meet is their aim
            met = slice(len(rows.targets) - len(rows.depths), None)
            normal = slice(len(rows.laws) + met.start, len(rows.laws) + len(rows.targets))
            speed = system.free[normal] + system.delassus[normal] @ impulse
            rows.targets[met] = np.where(impulse[normal] > 0.0, speed, NEVER)
        setup.forget_losses()
        program = StepProgram.of(rows, system, inertia)
        return StepSolution(program, system, end.after, impulse, used, method)

    @cached_property
    def energy(self) -> EnergyFlow:
        """Work and losses.

        Effects that store energy of their own have lines of their own (`Effect.memory_energy`).
        """
        setup, state, _, step, external, _ = self.given
        books, forces = self.end.books.tolist(), self.forces
        motor, stores, work, outer = books[MOTOR], EnergyFlow(), 0.0, 0.0
        joint = self.end.force if external is None else self.end.force - external
        if forces.kept_joint is not None and forces.kept_rotor is not None and forces.stores:
            joint = joint - forces.kept_joint
            before = setup.drive.motion(state)[1]
            turned = 0.5 * step * setup.drive.ratio * (before + self.end.motor_speed)
            motor -= float(forces.kept_rotor @ turned)
            stores = _stores(setup, forces)
        if external is not None or setup.robot.effects:
            mean = 0.5 * (self.end.speed + self.end.after)
            work = float(step * (joint @ mean))
            outer = 0.0 if external is None else float(step * (external @ mean))
        return EnergyFlow(
            motor=motor,
            external=outer,
            effects=work,
            reloaded=stores.reloaded,
            bent=stores.bent,
            mesh=books[MESH],
            rotor_friction=books[ROTOR],
            gear_damping=books[GEAR],
            joint_friction=books[FRICTION],
            bristles=stores.bristles,
            contact=books[CONTACT],
        )


def _stores(setup: Setup, forces: EffectForces) -> EnergyFlow:
    """Return where the work went that effects with a store of their own took."""
    total = EnergyFlow()
    for effect, motion in forces.stores:
        found = effect.memory_energy(setup.robot, motion)
        if found is not None:
            total = total + EnergyFlow(
                reloaded=found.reloaded, bent=found.stored, bristles=found.lost
            )
    return total


def flow(given: PartInput) -> tuple[Flow, bool]:
    """Advance by `given.step`, or to the next touchdown; return whether more barriers are kept.

    Raises:
        SimulationError: the part has no solution, or several.
    """
    setup, state, command, step, external, kept = given
    plant, q = setup.plant, np.ascontiguousarray(state.position)
    v = np.ascontiguousarray(state.velocity)
    setup.begin(state, command, external)
    try:
        result, length, more = flow_until(plant, state.closed, kept, state.impulse, q, v, step)
        setup.heard()
        if more or result >= 10:
            given = given._replace(step=length, kept=plant.end.kept.copy())
        if result >= 10:
            raise _failed(given, result)
    finally:
        setup.forget_losses()  # impacts, and whatever comes next
    found, forces = Ended(setup.out.copy(), setup.cuts, plant.end.closed.copy(), result), setup.acts
    following = SimState(
        found.position,
        found.velocity,
        state.time + length,
        found.closed,
        found.impulse,
        found.deflection,
        found.motor_speed,
        forces.memory,
    )
    return Flow(following, found, forces, given), more


def _failed(given: PartInput, result: int) -> SimulationError:
    """Return the error for a part that has no solution."""
    setup, state, _, step, _, kept = given
    inertia, impulse = setup.plant.placed.inertia, setup.plant.end.impulse.copy()
    if result == 10 + NO_INERTIA or not np.isfinite(inertia).all():
        return blown_up(inertia, state.velocity)
    rows, system, _, _ = setup.in_rows(state, kept, step)
    if not np.isfinite(system.free).all():
        return blown_up(inertia, state.velocity)
    return unsolved(system, impulse[rows.places], tolerance_of(system))


class Course:
    """What a step has done so far, and what is left of it.

    Attributes:
        state: at the end of what is done.
        left: of the step [s].
        over: whether all of it is done.
        parts, impacts: what is done.
        kept: (2 j + c,) barriers that are rows of what is left of the step: they may close within
            it, but not be passed.
        keeps: whether there are any.
        struck: (2 j + c,) barriers that were reached within the step.
        slow: (2 j + c,) barriers that land too slowly for a part of their own.
    """

    __slots__ = (
        "_command", "_external", "_setup", "_step", "impacts", "keeps", "kept", "left", "over",
        "parts", "slow", "state", "struck",
    )  # fmt: skip

    def __init__(
        self,
        setup: Setup,
        state: SimState,
        command: FloatArray,
        step: float,
        external: FloatArray | None,
    ) -> None:
        """Look which barriers are closed at the start, where the state does not know.

        Args:
            setup: the plant's.
            state: at the start.
            command: (m,) [N m] on the rotors.
            step: h [s].
            external: generalised force (nv,), None for none.

        Raises:
            SimulationError: a start inside the ground or beyond a joint limit.
        """
        self._setup, self._command, self._external = setup, command, external
        self._step = self.left = step
        self.state, self.over, self.keeps = state, False, False
        self.kept = self.slow = self.struck = setup.none
        self.parts: list[Flow] = []
        self.impacts: list[Impact] = []
        if len(state.closed) != setup.barriers.size:
            self.state, impact, fresh = settle(setup, state, step)
            if impact is not None:
                self.impacts, self.struck = [impact], fresh

    def flow_on(self) -> None:
        """Flow smoothly to the end of the step, or to the next touchdown."""
        command, external = self._command, self._external
        given = PartInput(self._setup, self.state, command, self.left, external, self.kept)
        part, more = flow(given)
        if more:
            end = self._setup.plant.end
            self.slow, kept = self.slow | end.slow, end.kept | end.jumps
            self.kept, self.keeps = kept, bool(kept.any())
        self.parts.append(part)
        self.left -= part.step
        self.state, self.over = part.state, self.left <= 1e-9 * self._step

    def take_impact(self) -> None:
        """Stop at the barriers that the part before has reached.

        A kept row closes at some speed, which an impact is to take: at the end of the step for
        all, and before it for those that close faster than what is left of it can stop.
        """
        if self.over and not self.keeps:
            return
        setup, state, rows = self._setup, self.state, None
        again = self.struck is not setup.none
        if self.keeps:
            state = state.replace(closed=state.closed & ~self.kept)
            rows = None if self.over else self.kept
        springy = ~(self.struck | self.slow) if setup.restitution > 0.0 else None
        following = self._step if self.over else self.left
        self.state, impact, fresh = settle(setup, state, following, springy, rows)
        self.impacts += [impact] if impact is not None else []
        if again:
            self._keep(self.struck & fresh)
        self.struck = self.struck | fresh if again else fresh

    def _keep(self, more: BoolArray) -> None:
        """Keep barriers (2 j + c,) as rows of what is left of the step."""
        self.kept = self.kept | more
        self.keeps = bool(self.kept.any())
