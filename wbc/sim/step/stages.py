"""The stages of a step as Python sees them: smooth parts, and the impacts between them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.mechanics.newton import SEVERAL, WAYS
from wbc.sim.setup import EffectActs, Setup, memory_before
from wbc.sim.step import books, impact
from wbc.sim.step.course import IMPACT_FAILED, NO_COMMAND, look_again
from wbc.sim.step.self_locking import several
from wbc.sim.step.solution import MISSED, NO_INERTIA, USED, WAY
from wbc.sim.step.tables import LENGTH, RESTITUTION, TIME, TOUCH, SimState

_SOLUTIONS = 27  # most that an error tells of


@dataclass(frozen=True, slots=True)
class EnergyFlow:
    """Work in and losses out over some time, each in joule.

    Motor and external work are exact for the impulses and displacements of the step; each loss is
    impulse times the speed at the end of the step, which makes it non-negative, and differs from
    the exact one by O(h^2) per step. That, and the weight that is lifted where an overlap is
    taken back, is the audit's residual.

    Attributes:
        motor: work of the rotor torques.
        external: work of external forces given to the step.
        effects: work of the robot's effects that are no friction (springs, drag, ripple).
        reloaded: what bent bristles gained because the load on them changed.
        bent: change of what bristles hold (presliding).
        mesh: lost in the meshes.
        rotor_friction: lost in rotor bearings and motors.
        gear_damping: lost between mesh and joint, where gears are compliant or have play.
        joint_friction: lost in joint friction.
        bristles: lost in friction that builds up (presliding).
        contact: lost in sliding contacts, and where one closes without an impact.
        impact_mesh: lost in the meshes during impacts.
        impact: lost in contacts and joint limits during impacts.
    """

    motor: float = 0.0
    external: float = 0.0
    effects: float = 0.0
    reloaded: float = 0.0
    bent: float = 0.0
    mesh: float = 0.0
    rotor_friction: float = 0.0
    gear_damping: float = 0.0
    joint_friction: float = 0.0
    bristles: float = 0.0
    contact: float = 0.0
    impact_mesh: float = 0.0
    impact: float = 0.0

    def __add__(self, other: EnergyFlow) -> EnergyFlow:
        """Return the sum of two flows."""
        return EnergyFlow(*[getattr(self, name) + getattr(other, name) for name in _NAMES])

    @property
    def work(self) -> float:
        """All work done on the robot, and on what is bent in it."""
        return self.motor + self.external + self.effects + self.reloaded

    @property
    def losses(self) -> dict[str, float]:
        """Every loss by its cause."""
        return {name: float(getattr(self, name)) for name in _LOSSES}

    @property
    def lost(self) -> float:
        """Sum of all losses."""
        return sum(self.losses.values())


_NAMES = tuple(field.name for field in fields(EnergyFlow))
_LOSSES = _NAMES[_NAMES.index("mesh") :]


@dataclass(frozen=True, slots=True)
class EnergyAudit:
    """Work in = change of mechanical energy + losses + residual.

    Attributes:
        flow: work and losses of the run.
        stored: change of kinetic plus potential energy of links, rotors and gear springs [J].
        joule_heat: of the windings, R (tau / k_t)^2 over time [J]; NaN where a motor's constants
            are unknown. It comes from the supply beside the motors' work and is no part of the
            balance above.
    """

    flow: EnergyFlow
    stored: float
    joule_heat: float = np.nan

    @property
    def residual(self) -> float:
        """What the books do not close by [J]; O(dt) by the order of the time step."""
        return self.flow.work - self.stored - self.flow.bent - self.flow.lost

    @property
    def electric(self) -> float:
        """What the supply gives, less what it gets back: motor work plus Joule heat [J]."""
        return self.flow.motor + self.joule_heat

    def __str__(self) -> str:
        """Return the books as a table."""
        flow = self.flow
        bristles = ("stored in bristles", flow.bent), ("bristles loaded anew", flow.reloaded)
        rows = [
            ("motor work", self.flow.motor),
            ("external work", self.flow.external),
            ("work of effects", self.flow.effects),
            ("stored", self.stored),
            *(bristles if any(size for _, size in bristles) else ()),
            *((f"lost: {name.replace('_', ' ')}", v) for name, v in self.flow.losses.items()),
            ("residual", self.residual),
        ]
        if np.isfinite(self.joule_heat):
            rows.append(("beside: Joule heat", self.joule_heat))
        return "\n".join(f"{name:24s}{value:14.6f} J" for name, value in rows)


class Course(NamedTuple):
    """What happened in one step.

    Attributes:
        setup: the plant's.
        start: state, with the memory of its effects.
        duration: of the step [s].
        external: generalised force (nv,), None for none.
        stages: (s + 1, w) the parts and impacts, and the end, see `Opened.stages`.
        acts: what effects did in each part, by the number of its stage; empty where loops know it.
    """

    setup: Setup
    start: SimState
    duration: float
    external: FloatArray | None
    stages: FloatArray
    acts: dict[int, EffectActs]

    def state(self, stage: int) -> SimState:
        """Return the state in which a stage starts; stage s is the end of the step."""
        setup, words, memory = self.setup, self.stages[stage], self.start.memory
        _, q, v, push, bent, spin, _ = setup.cuts
        closed = np.ndarray(setup.barriers.size, np.bool_, words, setup.closed_at)
        if self.acts:
            memory = memory_before(self.acts, stage, memory)
        at, kept = (words[q], words[v], words.item(TIME)), (words[push], words[bent], words[spin])
        return SimState(*at, closed, *kept, memory)

    @property
    def command(self) -> FloatArray:
        """(m,) [N m] on the rotors."""
        return self.stages[0, self.setup.cuts[-1]]


@dataclass(frozen=True, eq=False)
class Stage:
    """A part or an impact.

    Attributes:
        course: of the step.
        stage: its number in it.
    """

    course: Course
    stage: int

    @cached_property
    def end(self) -> Any:
        """What `Ending` held at its end, by the names of its fields."""
        setup = self.course.setup
        words = self.course.stages[self.stage, len(setup.plant.now.words) :]
        return np.ndarray((), setup.end_kind, words)

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot, world axes."""
        return np.asarray(self.end["pushes"].reshape(-1, 3))

    @property
    def missed(self) -> float:
        """Speed [m/s, rad/s] by which a passive end misses the laws, else zero."""
        return float(self.end["work"][MISSED])


class Flow(Stage):
    """What happened in one smooth part."""

    @cached_property
    def start(self) -> SimState:
        """At its start."""
        return self.course.state(self.stage)

    @cached_property
    def state(self) -> SimState:
        """At its end."""
        return self.course.state(self.stage + 1)

    @property
    def step(self) -> float:
        """h [s]."""
        return float(self.course.stages[self.stage, LENGTH])

    @property
    def iterations(self) -> int:
        """Linear systems solved."""
        return int(self.end["work"][USED])

    @property
    def method(self) -> str:
        """What found the impulses: "newton", or "proximal".

        "passive" where friction gave way, "ranges" where self-locking gears were held to a range
        of their laws.
        """
        return WAYS[int(self.end["work"][WAY])]

    @cached_property
    def energy(self) -> EnergyFlow:
        """Work and losses.

        Effects that store energy of their own have lines of their own (`Effect.memory_energy`).
        """
        setup, step, external, end = self.course.setup, self.step, self.course.external, self.end
        found, robot, drive = end["books"].tolist(), setup.robot, setup.drive
        motor, stored, work, outer = found[books.MOTOR], EnergyFlow(), 0.0, 0.0
        joint = end["force"] if external is None else end["force"] - external
        _, seen = self.course.acts.get(self.stage, ((), ()))
        for effect, motion in zip(setup.hooks, seen, strict=True):
            own = effect.memory_energy(robot, motion)
            if own is None:
                continue
            stored += EnergyFlow(reloaded=own.reloaded, bent=own.stored, bristles=own.lost)
            smooth, rotor = effect.joint_torque(robot, motion), effect.rotor_torque(robot, motion)
            joint = joint if smooth is None else joint - smooth
            if rotor is not None:
                turned = 0.5 * step * (drive.motion(self.start)[1] + end["motor_speed"])
                motor -= float(rotor @ (drive.gears.gear_ratio * turned))
        if external is not None or setup.robot.effects:
            mean = 0.5 * (end["speed"] + end["after"])
            work = float(step * (joint @ mean))
            outer = 0.0 if external is None else float(step * (external @ mean))
        losses = *found[books.MESH : books.CONTACT], 0.0, found[books.CONTACT]
        flow = EnergyFlow(motor, outer, work, 0.0, 0.0, *losses)
        return flow + stored if seen else flow


class Impact(Stage):
    """One impact."""

    @cached_property
    def state(self) -> SimState:
        """Just before."""
        return self.course.state(self.stage)

    @property
    def time(self) -> float:
        """[s]."""
        return self.state.time

    @property
    def before(self) -> FloatArray:
        """v (nv,) just before."""
        return self.state.velocity

    @property
    def after(self) -> FloatArray:
        """v (nv,) just after."""
        return np.asarray(self.end["after"])

    @property
    def restitution(self) -> float:
        """Normal speed after over before; as much less than the plant's as it would make energy."""
        return float(self.end["hit"][impact.SHARE] * self.course.setup.plant.bounds[RESTITUTION])

    @property
    def mesh_loss(self) -> float:
        """Energy lost in the gears [J]."""
        return float(self.end["hit"][impact.MESH])

    @property
    def contact_loss(self) -> float:
        """Energy lost in the contacts [J]."""
        return float(self.end["hit"][impact.CONTACT])

    @property
    def kinetic(self) -> float:
        """Energy before [J], of rotors included."""
        return float(self.end["hit"][impact.ENERGY])


def failure(setup: Setup, code: int, torque: FloatArray) -> SimulationError:
    """Return the error for what `take_step` returned with a command (m,) [N m]."""
    if code == NO_COMMAND:
        return SimulationError(f"rotor_torque holds a value that is no number: {torque}.")
    plant, joints = setup.plant, setup.robot.transmission.joints
    inertia, velocity = plant.placed.inertia.copy(), plant.now.velocity
    if code % 10 == NO_INERTIA or not np.isfinite(inertia).all():
        return blown_up(inertia, velocity)
    told = np.empty((_SOLUTIONS, len(joints)), dtype=np.int64)
    count, off, tolerance = look_again(plant, code >= IMPACT_FAILED, told)
    if not np.isfinite(off):
        return blown_up(inertia, velocity)
    if code % 10 == SEVERAL:
        yields = plant.gears.inertia / -plant.gears.backward
        return SimulationError(several(told, count, joints, yields))
    return SimulationError(
        f"a step has no solution within {tolerance:.1e} (nearest: {off:.1e}). Usual causes: a "
        "contact target that the joints cannot reach (a limit and the ground in conflict), or a "
        "self-locking gear whose falling branch leaves no solution; shorten the step or change the "
        "state."
    )


def blown_up(inertia: FloatArray, velocity: FloatArray) -> SimulationError:
    """Return the error for a step whose inertia was good once and is no longer.

    Args:
        inertia: H_l (n, n).
        velocity: v (n,) before the step.
    """
    with np.errstate(all="ignore"):
        energy = 0.5 * float(velocity @ inertia @ velocity)
        fastest = float(np.abs(velocity).max(initial=0.0))
    numbers = "the step has no numbers: " if np.isnan(velocity).any() else ""
    return SimulationError(
        f"{numbers}the state has blown up: {energy:.3g} J of kinetic energy, fastest coordinate "
        f"{fastest:.3g} rad/s (m/s). Look at the events of the steps before, and at the torques."
    )


def check_outside(setup: Setup, gap: FloatArray) -> None:
    """Refuse a start inside the ground or beyond a joint limit.

    Args:
        setup: the plant's.
        gap: of the barriers that do not yield, (2 j + c,) at most.

    Raises:
        SimulationError: an overlap beyond TOUCH; it names the place and the depth.
    """
    depth = -float(gap.min(initial=0.0))
    if depth <= TOUCH:
        return
    place = int(np.argmin(gap))
    where = setup.barriers.names[place]
    beyond = f"{depth:.3g} rad (m) beyond its stop"
    inside = f"{1e3 * depth:.3g} mm inside the ground"
    raise SimulationError(
        f"the start of '{setup.robot.name}' overlaps: {where} is "
        f"{beyond if place < setup.barriers.limits else inside}. Place the robot outside, or "
        "let the plant do it: plant.state(position, lifted=True)."
    )
