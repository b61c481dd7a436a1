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
from wbc.sim.setup import Setup, copied
from wbc.sim.state import SimState
from wbc.sim.step.books import CONTACT, FRICTION, GEAR, MESH, MISSED, MOTOR, ROTOR
from wbc.sim.step.forces import EffectForces
from wbc.sim.step.impacts import Impact, settle
from wbc.sim.step.landing import flow_until
from wbc.sim.step.program import StepProgram, StepSolution, blown_up, unsolved
from wbc.sim.step.solution import NEVER, NO_INERTIA, solve_part


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
        record: numbers of `Ending` at its end.
        left: whether some overlap is left to take back.
        forces: of the effects.
        given: what it started from.
    """

    state: SimState
    record: Any
    left: bool
    forces: EffectForces
    given: PartInput

    @cached_property
    def end(self) -> Any:
        """The record, whose fields are attributes."""
        return self.record.view(np.recarray)

    @property
    def step(self) -> float:
        """h [s]."""
        return self.given.step

    @property
    def missed(self) -> float:
        """Speed [m/s, rad/s] by which a passive end misses the laws, else zero."""
        return float(self.record["books"][MISSED])

    @property
    def gap(self) -> FloatArray:
        """(2 j + c,) at its end."""
        found: FloatArray = self.record["gap"]
        return found

    @property
    def overlap(self) -> FloatArray:
        """(2 j + c,) depth [m, rad] beyond the plant's return speed; empty where none is left."""
        found: FloatArray = self.record["depth"]
        return found if self.left else found[:0]

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot, world axes."""
        return np.asarray(self.record["pushes"].reshape(-1, 3))

    @property
    def rotor_impulse(self) -> FloatArray:
        """Impulse (m,) [N m s] delivered on the rotors."""
        return self.step * self.forces.rotor

    @cached_property
    def solution(self) -> StepSolution:
        """Of the step program, which is put together and solved again."""
        setup, state, _, step, external, kept = self.given
        end = self.end
        if setup.waits:
            setup.tell_coupling(end.before, end.speed)
            setup.tell_losses(end.before, end.speed)
        setup.tell_motion(state)
        setup.tell_forces(self.forces, external)
        rows, system, start, inertia = setup.in_rows(state, kept, step)
        used, way = end.work.astype(int).tolist()
        impulse = end.impulse[rows.places]
        asked = used == 0 and len(impulse) > 0  # Python solved the rows
        given = impulse if asked else impulse[:0]
        solve_part(setup.plant, rows, system, end.speed, start, step, 1.0, given)
        if len(rows.depths):  # what compliant contacts meet is their aim
            met = slice(len(rows.targets) - len(rows.depths), None)
            normal = slice(len(rows.laws) + met.start, len(rows.laws) + len(rows.targets))
            speed = system.free[normal] + system.delassus[normal] @ impulse
            rows.targets[met] = np.where(impulse[normal] > 0.0, speed, NEVER)
        setup.forget_losses()
        program = StepProgram.of(rows, system, inertia)
        return StepSolution(
            program, system, end.after, impulse, used, "ranges" if asked else WAYS[way]
        )

    @cached_property
    def energy(self) -> EnergyFlow:
        """Work and losses.

        Effects that store energy of their own have lines of their own (`Effect.memory_energy`).
        """
        setup, state, _, step, external, _ = self.given
        books, forces = self.record["books"].tolist(), self.forces
        motor, stored, work, outer = books[MOTOR], EnergyFlow(), 0.0, 0.0
        joint = self.end.force if external is None else self.end.force - external
        if forces.kept_joint is not None and forces.kept_rotor is not None and forces.stores:
            joint = joint - forces.kept_joint
            before = setup.drive.motion(state)[1]
            turned = 0.5 * step * setup.drive.ratio * (before + self.end.motor_speed)
            motor -= float(forces.kept_rotor @ turned)
            for effect, motion in forces.stores:
                found = effect.memory_energy(setup.robot, motion)
                if found is not None:
                    stored += EnergyFlow(
                        reloaded=found.reloaded, bent=found.stored, bristles=found.lost
                    )
        if external is not None or setup.robot.effects:
            mean = 0.5 * (self.end.speed + self.end.after)
            work = float(step * (joint @ mean))
            outer = 0.0 if external is None else float(step * (external @ mean))
        return EnergyFlow(
            motor=motor,
            external=outer,
            effects=work,
            reloaded=stored.reloaded,
            bent=stored.bent,
            mesh=books[MESH],
            rotor_friction=books[ROTOR],
            gear_damping=books[GEAR],
            joint_friction=books[FRICTION],
            bristles=stored.bristles,
            contact=books[CONTACT],
        )


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
    record, forces = copied(setup.ending), setup.acts
    following = SimState(
        record["position"],
        record["velocity"],
        state.time + length,
        plant.end.closed.copy(),
        record["impulse"],
        record["deflection"],
        record["motor_speed"],
        forces.memory,
    )
    return Flow(following, record, result < 0, forces, given), more


def _failed(given: PartInput, result: int) -> SimulationError:
    """Return the error for a part that has no solution."""
    setup, state, _, step, _, kept = given
    inertia, impulse = setup.plant.placed.inertia, setup.plant.end.impulse.copy()
    if result == 10 + NO_INERTIA or not np.isfinite(inertia).all():
        return blown_up(inertia, state.velocity)
    rows, system, _, _ = setup.in_rows(state, kept, step)
    if not np.isfinite(system.free).all():
        return blown_up(inertia, state.velocity)
    return unsolved(system, impulse[rows.places])


def take_step(
    setup: Setup, state: SimState, command: FloatArray, step: float, external: FloatArray | None
) -> tuple[SimState, tuple[Flow, ...], tuple[Impact, ...]]:
    """Return the state after a step, its smooth parts, and the impacts between them.

    Barriers that are kept are rows of what is left of the step: they may close within it, but not
    be passed. A kept row closes at some speed, which an impact is to take: at the end of the step
    for all, and before it for those that close faster than what is left of it can stop.

    Args:
        setup: the plant's.
        state: at the start.
        command: (m,) [N m] on the rotors.
        step: h [s].
        external: generalised force (nv,), None for none.

    Raises:
        SimulationError: a start inside the ground or beyond a joint limit, or a part or an impact
            without a solution, or with several.
    """
    parts: list[Flow] = []
    impacts: list[Impact] = []
    left, kept = step, setup.none
    slow = struck = setup.none  # land too slowly for a part of their own; reached within the step
    if len(state.closed) != setup.barriers.size:
        state, impact, fresh = settle(setup, state, step, setup.back, setup.none)
        if impact is not None:
            impacts, struck = [impact], fresh
    over = False
    while not over:
        part, more = flow(PartInput(setup, state, command, left, external, kept))
        if more:
            end = setup.plant.end
            slow, kept = slow | end.slow, end.kept | end.jumps
        parts.append(part)
        left, state, keeps = left - part.step, part.state, kept is not setup.none and kept.any()
        over = left <= 1e-9 * step
        if over and not keeps:
            break
        if keeps:
            state = state.replace(closed=state.closed & ~kept)
        back, rows = setup.back, kept if keeps and not over else setup.none
        if setup.restitution > 0.0:
            back = np.where(struck | slow, 0.0, back)
        state, impact, fresh = settle(setup, state, step if over else left, back, rows)
        impacts += [impact] if impact is not None else []
        if struck is not setup.none:
            kept = kept | (struck & fresh)
        struck = struck | fresh
    return state, tuple(parts), tuple(impacts)
