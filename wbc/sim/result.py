"""What one step of the plant returns, and what it has to say beside its state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add

import numpy as np

from wbc.arrays import FloatArray
from wbc.mechanics.kinematics import place
from wbc.sim.setup import Setup, Survey
from wbc.sim.step.books import KINETIC, MADE, NORMAL, TAKEN, TRAFFIC
from wbc.sim.step.stages import Course, EnergyAudit, EnergyFlow, Flow, Impact
from wbc.sim.step.tables import LENGTH, RETURN_SPEED, TOUCH, SimState

_ROUNDING = 1e-8  # of the energy in play: laws hold to 1e-10 of the speeds
_COARSE = 0.01  # share of the energy in play


@dataclass(frozen=True, slots=True)
class StepEvent:
    """One thing that a user of a step should know.

    Attributes:
        kind: one of these five.
            "energy": contacts, stops or gears made energy, which no law allows.
            "coarse": the energy balance of the step gained more than a hundredth of the energy in
            play, or more energy was stored at its end than it was given, or that was taken from
            speeds that no law bounds (`sim/step/books`). A shorter step mends it.
            "unsettled": the budget of work ended before all laws were met. Friction is that of the
            impulses found so far, or flanks, soft contacts or coupled rotors are not settled.
            "overlap": a barrier was overrun further than one step takes back, see `return_speed`.
            "sunk": a joint of a robot with a free base is under the ground, because its link has
            no contact there.
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
        state: at the end.
        courses: of the steps that it stands for, one or several in a row.
    """

    state: SimState
    courses: tuple[Course, ...]

    @property
    def duration(self) -> float:
        """Of the steps together [s]."""
        return sum(course.duration for course in self.courses)

    @property
    def command(self) -> FloatArray:
        """(m,) [N m] on the rotors that the motors took, within their bounds; a mean of steps."""
        taken = [course.duration / self.duration * course.command for course in self.courses]
        return np.asarray(reduce(add, taken))

    @property
    def start(self) -> SimState:
        """The state it started from."""
        return self.courses[0].start

    @property
    def setup(self) -> Setup:
        """The plant's."""
        return self.courses[0].setup

    @property
    def parts(self) -> tuple[Flow, ...]:
        """The smooth parts of the step; more than one where something landed in between."""
        return tuple(stage for stage in self._stages if isinstance(stage, Flow))

    @property
    def impacts(self) -> tuple[Impact, ...]:
        """Those that happened in the step."""
        return tuple(stage for stage in self._stages if isinstance(stage, Impact))

    @cached_property
    def _stages(self) -> list[Flow | Impact]:
        """All parts and impacts in turn."""
        return [
            (Flow if length > 0.0 else Impact)(course, stage)
            for course in self.courses
            for stage, length in enumerate(course.stages[:-1, LENGTH])
        ]

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
    def rotor_torque(self) -> FloatArray:
        """(m,) [N m] that the drives delivered, mean over the step."""
        pushes = [part.step * part.end["torque"] for part in self.parts]
        return np.asarray(reduce(add, pushes) / self.duration)

    @property
    def unsettled(self) -> int:
        """How many parts and impacts ended passively, without meeting all laws."""
        return sum(1 for _ in self._unsettled())

    @cached_property
    def energy(self) -> EnergyFlow:
        """Work and losses."""
        hits = [EnergyFlow(impact_mesh=i.mesh_loss, impact=i.contact_loss) for i in self.impacts]
        return reduce(add, [*(part.energy for part in self.parts), *hits])

    @cached_property
    def balance(self) -> EnergyAudit:
        """Work in, energy stored, losses, and what they do not close by."""
        (before, _, _), (after, _, _) = self._surveys
        return EnergyAudit(self.energy, after - before)

    @cached_property
    def events(self) -> tuple[StepEvent, ...]:
        """Energy that the step made, overlaps that are left; empty in a good step."""
        return (
            *self._overlaps(),
            *self._made(),
            *self._sunk(),
            *self._unsettled(),
            *self._coarse(),
        )

    def _overlaps(self) -> Iterator[StepEvent]:
        for part in self.parts:
            if (depth := float(part.end["depth"].max(initial=0.0))) > 0.0:
                worst = int(part.end["depth"].argmax())
                text = (
                    f"{self.setup.barriers.names[worst]} is {depth:.3g} m (rad) inside; it is "
                    f"taken back at {self.setup.plant.bounds[RETURN_SPEED]:g} m/s (rad/s)"
                )
                yield StepEvent("overlap", part.state.time, depth, text)

    def _made(self) -> Iterator[StepEvent]:
        """Yield parts and impacts of whose losses one is negative beyond rounding."""
        found = []
        for part in self.parts:
            books = part.end["books"].tolist()
            losses = part.energy.losses | {"normal": -books[NORMAL]}
            cause = min(losses, key=lambda name: losses[name])
            play = books[KINETIC] + books[TRAFFIC]
            found.append((part.state.time, losses[cause], cause.replace("_", " "), play))
        for hit in self.impacts:
            found.append((hit.time, hit.mesh_loss, "impact, mesh", hit.kinetic))
            found.append((hit.time, hit.contact_loss, "impact, contact", hit.kinetic))
        for time, loss, cause, play in found:
            if loss < -_ROUNDING * play - 1e-12:
                text = f"the step made {-loss:.3g} J ({cause})"
                yield StepEvent("energy", time, -loss, text)

    def _sunk(self) -> Iterator[StepEvent]:
        """Yield the deepest joint under the ground at the end."""
        setup, tree, (_, (_, gap, lowest)) = self.setup, self.setup.plant.tree, self._surveys
        if not len(setup.plant.placed.bases) or not setup.robot.contacts:
            return
        if setup.plant.obstacles.asked:  # loops do not know all of the ground
            poses = np.empty((len(tree.joints), 12))
            place(tree.joints, tree.shapes, self.state.position, poses)
            links = (tree.shapes[:, 15] > 0.0).nonzero()[0]  # those with a mass
            gaps, _ = setup.terrain.gap(poses[links, 9:])
            gap, lowest = float(gaps.min()), int(links[np.argmin(gaps)])
        # Contacts may be as deep as a step leaves them.
        if gap < -TOUCH and gap < -float(self.parts[-1].end["depth"].max(initial=0.0)):
            text = (
                f"joint '{setup.robot.joints[lowest]}' is {-gap:.3g} m under the ground: no "
                "contact holds its link. Give the robot contacts there, or the link collision "
                "geometry"
            )
            yield StepEvent("sunk", self.state.time, -gap, text)

    def _unsettled(self) -> Iterator[StepEvent]:
        for time, missed in ((stage.state.time, stage.missed) for stage in self._stages):
            if missed > 0.0:
                text = (
                    f"laws are missed by {missed:.3g} m/s (rad/s): the budget of work ended before "
                    "friction, flanks, soft contacts or coupled rotors met them; a shorter dt may"
                )
                yield StepEvent("unsettled", time, missed, text)

    def _coarse(self) -> Iterator[StepEvent]:
        books, flow = [part.end["books"].tolist() for part in self.parts], self.balance.flow
        play = max(own[KINETIC] for own in books) + abs(flow.work) + flow.lost
        gain, taken = -self.balance.residual, sum(own[TAKEN] for own in books)
        if taken > 0.0 or gain > min(_COARSE * play, MADE * play + flow.lost) + 1e-9:
            gain = max(gain, taken)
            text = (
                f"the step is too long: of {play:.3g} J that it moved, {gain:.3g} J came from "
                f"nowhere{' and were taken from its speeds' if taken > 0.0 else ''}; shorten dt"
            )
            yield StepEvent("coarse", self.state.time, gain, text)

    @cached_property
    def _surveys(self) -> tuple[Survey, Survey]:
        """Energy that is stored at the start and at the end [J], and deepest bodies."""
        return self.setup.survey(self.start), self.setup.survey(self.state)

    @staticmethod
    def joined(results: Sequence[StepResult]) -> StepResult:
        """Return several steps in a row as one."""
        courses = tuple(course for result in results for course in result.courses)
        return StepResult(results[-1].state, courses)
