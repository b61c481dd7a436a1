"""One smooth part of a step as Python sees it: effects, coupling, the compiled part, its energy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.mechanics.newton import WAYS
from wbc.sim.energy import EnergyFlow
from wbc.sim.setup import Setup
from wbc.sim.state import SimState
from wbc.sim.step.books import CONTACT, FRICTION, GEAR, MESH, MISSED, MOTOR, ROTOR
from wbc.sim.step.flanks import grip_laws
from wbc.sim.step.forces import EffectForces
from wbc.sim.step.motion import to_middle
from wbc.sim.step.part import LANDED, part_in_rows, part_of_step, second_half
from wbc.sim.step.program import (
    StepProgram,
    StepSolution,
    blown_up,
    solve_rows,
    tolerance_of,
    unsolved,
)
from wbc.sim.step.solution import NEVER, NO_INERTIA, UNDECIDED, couple

_MESH_ROUNDS = 40
_MESH_TOLERANCE = 1e-9  # of the torque that a gear carries; steps are solved to 1e-10
# Change of what a gear carries per change of what its loss assumes: below it lies a loss of 95 % of
# the power forward, above it one of 95 % backward; beyond them is rounding.
_MESH_SLOPES = (-19.0, 0.95)


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


class PartInput(NamedTuple):
    """What one smooth part starts from.

    Attributes:
        setup: the plant's.
        state: with known `closed`, and with the memory of its effects.
        command: (m,) rotor torque [N m].
        step: h [s].
        external: generalised force (nv,), None for none.
        kept: (2 j + c,) barriers that may close within the part, without a bounce.
        mesh: (m,) [N m] that effects take the gears to carry, None for what they remember.
    """

    setup: Setup
    state: SimState
    command: FloatArray
    step: float
    external: FloatArray | None
    kept: BoolArray
    mesh: FloatArray | None = None


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
    def landed(self) -> bool:
        """Whether a barrier that is not closed is passed at its end."""
        return self.end.landed

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
        setup, state, _, step, external, kept, _ = self.given
        end, plant = self.end, setup.plant
        if setup.waits:
            setup.tell_coupling(end.before, end.speed)
            setup.tell_losses(end.before, end.speed)
        setup.tell_motion(state)
        setup.tell_forces(self.forces, external)
        rows, system, _, inertia = _in_rows(setup, state, kept, step)
        couple(plant, rows, system, end.speed, end.after, step)
        grip_laws(plant.gears, rows.relative, step, end.after, end.motor_speed, system.laws)
        used, way = end.work.astype(int).tolist()
        method, impulse = "ranges" if end.given else WAYS[way], end.impulse[rows.places]
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
        setup, state, _, step, external, _, _ = self.given
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


def flow(given: PartInput) -> Flow:
    """Advance by `given.step` with the barriers that are closed at its start.

    Raises:
        SimulationError: the part has no solution, or several.
    """
    found = _once(given)
    if given.setup.meshed:
        return _with_mesh(found, lambda mesh: _once(given._replace(mesh=mesh)))
    return found


def _with_mesh(first: Flow, solve: Callable[[FloatArray], Flow]) -> Flow:
    """Return the part in which effects see the torque that the gears then carry.

    Secant steps of each gear alone, from what its effect remembers of the step before: what a gear
    carries is nearly linear in what it is taken to carry, and other gears change it little.
    """
    taken = first.mesh_impulse / first.step
    miss, change, slope = np.zeros((3, len(taken)))
    for _ in range(_MESH_ROUNDS):
        found = solve(taken)
        carried = found.mesh_impulse / found.step
        before, miss = miss, carried - taken
        if np.all(np.abs(miss) <= _MESH_TOLERANCE * (1.0 + np.abs(carried))):
            break
        moved = change != 0.0
        ratio = (miss - before) / np.where(moved, change, 1.0)
        slope = np.where(moved, np.clip(1.0 + ratio, *_MESH_SLOPES), slope)
        change = miss / (1.0 - slope)
        taken = taken + change
    return found


def _once(given: PartInput) -> Flow:
    """Return the part for what effects take the gears to carry."""
    setup, state, command, step, _, _, mesh = given
    if setup.waits:
        q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
        to_middle(setup.plant, q, v, 0.5 * step, state.closed)
        position, velocity = setup.plant.end.middle.copy(), setup.plant.end.speed.copy()
        at, of_motor = (position, velocity, state.time + 0.5 * step), (setup.temperature, mesh)
        forces = setup.effects.forces(at, command, state.memory, step, *of_motor)
        setup.tell_losses(position, velocity)
        setup.tell_coupling(position, velocity)
    else:
        forces = EffectForces(setup.still, None, setup.effects.delivered(command), ())
    try:
        found = _part(given, forces)
    finally:
        setup.forget_losses()  # impacts, and whatever comes next
    following = SimState(
        found.position,
        found.velocity,
        state.time + step,
        found.closed,
        found.impulse,
        found.deflection,
        found.motor_speed,
        forces.memory,
    )
    return Flow(following, found, forces, given)


def _part(given: PartInput, forces: EffectForces) -> Ended:
    """Return where a part ends; where Python had to do with its middle, the memory stands there.

    Raises:
        SimulationError: the part has no solution, or several.
    """
    setup, state, _, step, external, kept, _ = given
    plant, impulse = setup.plant, np.zeros(0)
    setup.tell_motion(state)
    setup.tell_forces(forces, external)
    before, v = (state.closed, kept, state.impulse), np.ascontiguousarray(state.velocity)
    if setup.waits:
        result = second_half(plant, *before, impulse, v, step)
    else:
        result = part_of_step(plant, *before, np.ascontiguousarray(state.position), v, step)
    if result == 10 + UNDECIDED:
        _, system, start, _ = _in_rows(setup, state, kept, step)
        impulse, _, _ = solve_rows(system, start, setup.robot.transmission.joints)
        result = second_half(plant, *before, impulse, v, step)
    setup.heard()
    ended = Ended(setup.out.copy(), setup.cuts, plant.end.closed.copy(), result)
    ended.given = len(impulse) > 0
    if result >= 10:
        inertia = plant.placed.inertia
        if result == 10 + NO_INERTIA or not np.isfinite(inertia).all():
            raise blown_up(inertia, state.velocity)
        rows, system, _, _ = _in_rows(setup, state, kept, step)
        if not np.isfinite(system.free).all():
            raise blown_up(inertia, state.velocity)
        raise unsolved(system, ended.impulse[rows.places], tolerance_of(system))
    return ended


def _in_rows(setup: Setup, state: SimState, kept: BoolArray, step: float) -> Any:
    """Return what `part_in_rows` does; the loops have been told motion and forces."""
    q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
    return part_in_rows(setup.plant, state.closed, kept, state.impulse, q, v, step)
