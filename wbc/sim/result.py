"""What one step of the plant returns, and what it has to say beside its state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.mechanics.newton import WAYS
from wbc.sim.energy import EnergyAudit, EnergyFlow
from wbc.sim.setup import EffectActs, Setup
from wbc.sim.step.books import find_events
from wbc.sim.step.part_rows import MISSED, USED, WAY
from wbc.sim.step.tables import BOOK, LENGTH, RESTITUTION, RETURN_SPEED, TIME, SimState

_NONE = np.empty(0)
_COARSE = "the step is too long: of {what} J that it moved, {size:.3g} J came from nowhere"
# Kinds of events with their texts, by the numbers that the loops have for them.
_TEXTS = (
    ("energy", "the step made {size:.3g} J ({what})"),
    ("coarse", f"{_COARSE}; shorten dt"),
    ("coarse", f"{_COARSE} and were taken from its speeds; shorten dt"),
    (
        "unsettled",
        "laws are missed by {size:.3g} m/s (rad/s): the budget of work ended before friction or "
        "coupled rotors met them; a shorter dt may",
    ),
    ("overlap", "{what} is {size:.3g} m (rad) inside; it is taken back at {speed:g} m/s (rad/s)"),
    (
        "sunk",
        "joint '{what}' is {size:.3g} m under the ground: no contact holds its link. Give the "
        "robot contacts there, or the link collision geometry",
    ),
)


@dataclass(frozen=True, slots=True)
class StepEvent:
    """One thing that a user of a step should know.

    Attributes:
        kind: one of these five.
            "energy": contacts, stops or gears made energy, which no law allows.
            "coarse": the energy balance of the step gained more than a hundredth of the energy in
            play, or more energy was stored at its end than it was given, or that was taken from
            speeds that no law bounds (`sim/step/part`). A shorter step mends it.
            "unsettled": the budget of work ended before all laws were met. Friction is that of the
            impulses found so far, or coupled rotors are not settled.
            "overlap": a barrier was overrun further than one step takes back, see `return_speed`.
            "sunk": a joint of a robot with a free base is under the ground, because its link has
            no contact there. Of ground that only Python knows nothing is said.
        time: [s], at the end of the part it happened in.
        size: [J], depth [m, rad], or speed [m/s, rad/s] by which laws are missed.
        text: the same as a sentence.
    """

    kind: str
    time: float
    size: float
    text: str


@dataclass(frozen=True, eq=False)
class StepResult:
    """The next state and what led there.

    Attributes:
        setup: the plant's.
        start: the state it started from, with the memory of its effects.
        state: at the end.
        duration: of the step [s].
        stages: (s + 1, w) the parts and impacts, and the end, see `Opened.stages`.
        acts: what effects did in each part, by the number of its stage; empty where loops know it.
    """

    setup: Setup
    start: SimState
    state: SimState
    duration: float
    stages: FloatArray
    acts: dict[int, EffectActs]

    def state_at(self, stage: int) -> SimState:
        """Return the state in which a stage starts; stage s is the end of the step."""
        return self.setup.state_at(self.start.memory, self.stages, self.acts, stage)

    @property
    def command(self) -> FloatArray:
        """(m,) [N m] on the rotors that the motors took, within their bounds."""
        return np.asarray(self.setup.now_at(self.stages[0])["command"])

    @cached_property
    def parts(self) -> tuple[Flow, ...]:
        """The smooth parts of the step; more than one where something landed in between."""
        return tuple(stage for stage in self._stages if isinstance(stage, Flow))

    @cached_property
    def impacts(self) -> tuple[Impact, ...]:
        """Those that happened in the step."""
        return tuple(stage for stage in self._stages if isinstance(stage, Impact))

    @cached_property
    def _stages(self) -> list[Flow | Impact]:
        """All parts and impacts in turn."""
        lengths = enumerate(self.stages[:-1, LENGTH].tolist())
        return [(Flow if length > 0.0 else Impact)(self, stage) for stage, length in lengths]

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot at the plant's contacts, world axes, impacts excluded."""
        return self._pushed(self.parts)[: self.setup.barriers.points]

    @property
    def pair_impulse(self) -> FloatArray:
        """(p, 3) [N s] on the first body of each pair (`plant.pairs`), impacts included, world."""
        return self._pushed(self._stages)[self.setup.barriers.points :]

    @property
    def contact_force(self) -> FloatArray:
        """Mean force (k, 3) [N] on the robot over the step, impacts included, world axes."""
        return self._pushed(self._stages)[: self.setup.barriers.points] / self.duration

    @staticmethod
    def _pushed(stages: Sequence[Flow | Impact]) -> FloatArray:
        """Return the impulses (k + p, 3) on points and pairs in some stages."""
        return reduce(add, [stage.contact_impulse for stage in stages])

    @property
    def mesh_torque(self) -> FloatArray:
        """T (m,) [N m] after each mesh, mean over the step, impacts excluded."""
        passed = [part.end["mesh_impulse"] for part in self.parts]
        return np.asarray(reduce(add, passed) / self.duration)

    @property
    def unsettled(self) -> int:
        """How many parts and impacts ended passively, without meeting all laws."""
        return sum(stage.missed > 0.0 for stage in self._stages)

    @property
    def energy(self) -> EnergyFlow:
        """Work and losses."""
        flow = EnergyFlow._make(self.setup.now_at(self.stages[-1])["flow"].tolist())
        return reduce(add, [part.in_effects for part in self.parts], flow) if self.acts else flow

    @property
    def balance(self) -> EnergyAudit:
        """Work in, energy stored, losses, and what they do not close by."""
        before, after = (self.setup.survey(state)[0] for state in (self.start, self.state))
        return EnergyAudit(self.energy, after - before)

    @property
    def events(self) -> tuple[StepEvent, ...]:
        """Energy that the step made, overlaps that are left; empty in a good step."""
        told, setup = np.empty((3 * len(self.stages), 4)), self.setup
        flow = np.array(self.energy) if self.acts else _NONE
        count = find_events(setup.plant, self.stages, flow, told)
        setup.heard()
        return tuple([self._event(*event) for event in told[:count].tolist()])

    def _event(self, number: float, stage: float, size: float, what: float) -> StepEvent:
        """Return an event of `find_events` with its text."""
        (kind, text), setup = _TEXTS[int(number)], self.setup
        causes = [name.replace("_", " ") for name in BOOK._fields]
        of = {"energy": causes, "sunk": setup.robot.joints, "overlap": setup.barriers.names}
        word = of[kind][int(what)] if kind in of else f"{what:.3g}"
        speed, time = setup.plant.bounds[RETURN_SPEED], self.stages.item(int(stage) + 1, TIME)
        return StepEvent(kind, time, size, text.format(size=size, what=word, speed=speed))


@dataclass(frozen=True, eq=False)
class Stage:
    """A part or an impact.

    Attributes:
        result: of the step.
        stage: its number in it.
    """

    result: StepResult
    stage: int

    @cached_property
    def end(self) -> Any:
        """What `Ending` held at its end, by the names of its fields."""
        return self.result.setup.end_at(self.result.stages[self.stage])

    @cached_property
    def start(self) -> SimState:
        """At its start."""
        return self.result.state_at(self.stage)

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
    def state(self) -> SimState:
        """At its end."""
        return self.result.state_at(self.stage + 1)

    @property
    def step(self) -> float:
        """h [s]."""
        return float(self.result.stages[self.stage, LENGTH])

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

    @property
    def in_effects(self) -> EnergyFlow:
        """Energy of effects that store some of their own (`Effect.memory_energy`).

        Their work is taken out of that of the motors and of other effects.
        """
        result, half, end = self.result, 0.5 * self.step, self.end
        robot, drive, found = result.setup.robot, result.setup.drive, EnergyFlow()
        moved = half * (end["speed"] + end["after"])
        for effect, motion in zip(result.setup.hooks, result.acts[self.stage][1], strict=True):
            own = effect.memory_energy(robot, motion)
            if own is None:
                continue
            found += EnergyFlow(reloaded=own.reloaded, bent=own.stored, bristles=own.lost)
            smooth, rotor = effect.joint_torque(robot, motion), effect.rotor_torque(robot, motion)
            if smooth is not None:
                found += EnergyFlow(effects=-float(smooth @ moved))
            if rotor is not None:
                turned = half * (drive.motion(self.start)[1] + end["motor_speed"])
                found += EnergyFlow(motor=-float(rotor @ (drive.gears.gear_ratio * turned)))
        return found


class Impact(Stage):
    """One impact."""

    @property
    def state(self) -> SimState:
        """Just before."""
        return self.start

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
        most = self.result.setup.plant.bounds[RESTITUTION]
        return float(self.end["books"][BOOK.share] * most)

    @property
    def mesh_loss(self) -> float:
        """Energy lost in the gears [J]."""
        return float(self.end["books"][BOOK.impact_mesh])

    @property
    def contact_loss(self) -> float:
        """Energy lost in the contacts [J]."""
        return float(self.end["books"][BOOK.impact])
