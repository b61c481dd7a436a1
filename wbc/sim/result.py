"""What one step of the plant returns, and what it has to say beside its state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add

import numpy as np

from wbc.arrays import FloatArray
from wbc.mechanics.kinematics import place
from wbc.sim.barriers import TOUCH
from wbc.sim.energy import EnergyAudit, EnergyFlow, surveyed
from wbc.sim.setup import Setup
from wbc.sim.state import SimState
from wbc.sim.step.books import KINETIC, NORMAL, TAKEN, TRAFFIC
from wbc.sim.step.passive import MADE
from wbc.sim.step.program import StepSolution
from wbc.sim.step.stages import Course, Flow, Impact

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
            speeds that no law bounds (`sim/step/passive`). A shorter step mends it.
            "unsettled": the budget of work ended before all laws were met. Friction is that of the
            impulses found so far, or flanks of gears or the coupling of rotors are not settled.
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
        state: at the end of the step.
        duration: dt [s].
        command: (m,) [N m] on the rotors that the motors took, within their bounds; as a mean where
            several steps are joined.
        courses: of the steps that it stands for, one or several in a row.
    """

    state: SimState
    duration: float
    command: FloatArray
    courses: tuple[Course, ...]

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
        return self._stages[0]

    @property
    def impacts(self) -> tuple[Impact, ...]:
        """Those that happened in the step."""
        return self._stages[1]

    @cached_property
    def _stages(self) -> tuple[tuple[Flow, ...], tuple[Impact, ...]]:
        """All parts, and all impacts."""
        parts, impacts = zip(*(course.divided() for course in self.courses), strict=True)
        return reduce(add, parts), reduce(add, impacts)

    @property
    def contact_impulse(self) -> FloatArray:
        """(k, 3) [N s] on the robot at the plant's contacts, world axes, impacts excluded."""
        points = self.setup.barriers.points
        return reduce(add, [part.contact_impulse for part in self.parts])[:points]

    @property
    def pair_impulse(self) -> FloatArray:
        """(p, 3) [N s] on the first body of each pair (`plant.pairs`), impacts included, world."""
        pushes = [part.contact_impulse for part in self.parts]
        pushes += [impact.contact_impulse for impact in self.impacts]
        return reduce(add, pushes)[self.setup.barriers.points :]

    @property
    def contact_force(self) -> FloatArray:
        """Mean force (k, 3) [N] on the robot over the step, impacts included, world axes."""
        points = self.setup.barriers.points
        hits = [impact.contact_impulse[:points] for impact in self.impacts]
        return np.asarray(reduce(add, [self.contact_impulse, *hits]) / self.duration)

    @property
    def mesh_torque(self) -> FloatArray:
        """T (m,) [N m] after each mesh, mean over the step, impacts excluded."""
        return np.asarray(reduce(add, [part.mesh_impulse for part in self.parts]) / self.duration)

    @property
    def rotor_torque(self) -> FloatArray:
        """(m,) [N m] that the drives delivered, mean over the step."""
        return np.asarray(reduce(add, [part.rotor_impulse for part in self.parts]) / self.duration)

    @property
    def unsettled(self) -> int:
        """How many parts and impacts ended passively, without meeting all laws."""
        ends = [part.missed for part in self.parts] + [impact.missed for impact in self.impacts]
        return sum(missed > 0.0 for missed in ends)

    @cached_property
    def energy(self) -> EnergyFlow:
        """Work and losses."""
        hits = [EnergyFlow(impact_mesh=i.mesh_loss, impact=i.contact_loss) for i in self.impacts]
        return reduce(add, [*(part.energy for part in self.parts), *hits])

    @cached_property
    def balance(self) -> EnergyAudit:
        """Work in, energy stored, losses, and what they do not close by."""
        before, _, _ = surveyed(self.setup, self.start)
        return EnergyAudit(self.energy, self._end[0] - before)

    @cached_property
    def events(self) -> tuple[StepEvent, ...]:
        """Energy that the step made, overlaps that are left; empty in a good step."""
        return events_of(self.setup, self.parts, self.impacts, self.balance, self._end)

    @cached_property
    def _end(self) -> tuple[float, float, int]:
        """Energy that is stored at the end [J], and the deepest body, see `survey`."""
        return surveyed(self.setup, self.state)

    @property
    def solutions(self) -> tuple[StepSolution, ...]:
        """Of the step programs, one per part of the step."""
        return tuple(part.solution for part in self.parts)

    @staticmethod
    def joined(results: Sequence[StepResult]) -> StepResult:
        """Return several steps in a row as one."""
        duration = sum(result.duration for result in results)
        return StepResult(
            state=results[-1].state,
            duration=duration,
            command=reduce(add, [one.duration / duration * one.command for one in results]),
            courses=tuple(course for result in results for course in result.courses),
        )


def events_of(
    setup: Setup,
    parts: Sequence[Flow],
    impacts: Sequence[Impact],
    balance: EnergyAudit,
    end: tuple[float, float, int],
) -> tuple[StepEvent, ...]:
    """Return what happened in the parts and impacts of a step.

    Args:
        setup: the plant's.
        parts, impacts: of the step.
        balance: of its energy.
        end: what `survey` found at its end.
    """
    found = [*_overlaps(setup, parts), *_made(parts, impacts), *_sunk(setup, parts[-1], *end[1:])]
    found += _unsettled([(part.state.time, part.missed) for part in parts])
    found += _unsettled([(impact.time, impact.missed) for impact in impacts])
    kinetic = max(float(part.end.books[KINETIC]) for part in parts)
    play = kinetic + abs(balance.flow.work) + balance.flow.lost
    gain = -balance.residual
    made = gain - balance.flow.lost
    taken = sum(float(part.end.books[TAKEN]) for part in parts)
    if taken > 0.0 or gain > _COARSE * play + 1e-9 or made > MADE * play + 1e-9:
        gain = max(gain, taken)
        text = (
            f"the step is too long: of {play:.3g} J that it moved, {gain:.3g} J came from nowhere"
            f"{' and were taken from its speeds' if taken > 0.0 else ''}; shorten dt"
        )
        found.append(StepEvent("coarse", parts[-1].state.time, gain, text))
    return tuple(found)


def _unsettled(ends: Sequence[tuple[float, float]]) -> Iterator[StepEvent]:
    """Yield the ends (time, speed) that miss laws."""
    for time, missed in ends:
        if missed > 0.0:
            text = (
                f"laws are missed by {missed:.3g} m/s (rad/s): the budget of work ended before "
                "friction, flanks of gears or the coupling of rotors met them; a shorter dt may"
            )
            yield StepEvent("unsettled", time, missed, text)


def _overlaps(setup: Setup, parts: Sequence[Flow]) -> Iterator[StepEvent]:
    for part in parts:
        if len(part.overlap):
            worst = int(np.argmax(part.overlap))
            depth = float(part.overlap[worst])
            yield StepEvent(
                "overlap",
                part.state.time,
                depth,
                f"{setup.barriers.names[worst]} is {depth:.3g} m (rad) inside; it is taken back "
                f"at {setup.return_speed:g} m/s (rad/s)",
            )


def _sunk(setup: Setup, last: Flow, gap: float, lowest: int) -> Iterator[StepEvent]:
    """Yield the deepest joint under the ground at the end of a step.

    Args:
        setup: the plant's.
        last: its last part.
        gap, lowest: of the deepest body, as far as loops know the ground.
    """
    state, tree = last.state, setup.tree
    if not setup.flies or not setup.robot.contacts:
        return
    if setup.barriers.asked:
        poses = np.empty((len(tree.joints), 12))
        place(tree.joints, tree.shapes, state.position, poses)
        links = (tree.shapes[:, 15] > 0.0).nonzero()[0]  # those with a mass
        gaps = setup.barriers.gaps_of(poses[links, 9:])
        gap, lowest = float(gaps.min()), int(links[np.argmin(gaps)])
    # Contacts may be as deep as a step leaves them.
    if gap < -TOUCH and gap < -float(np.max(last.overlap, initial=0.0)):
        yield StepEvent(
            "sunk",
            state.time,
            -gap,
            f"joint '{setup.robot.joints[lowest]}' is {-gap:.3g} m under the ground: no contact "
            "holds its link. Give the robot contacts there, or the link collision geometry",
        )


def _made(parts: Sequence[Flow], impacts: Sequence[Impact]) -> Iterator[StepEvent]:
    """Yield the parts and impacts one of whose losses is negative beyond rounding."""
    for part in parts:
        losses, books = part.energy.losses, part.end.books.tolist()
        losses["normal"] = -books[NORMAL]
        least = min(losses.values())
        if least < -_ROUNDING * (books[KINETIC] + books[TRAFFIC]) - 1e-12:
            cause = min(losses, key=lambda name: losses[name])
            yield _energy(part.state.time, -losses[cause], cause.replace("_", " "))
    for impact in impacts:
        for loss, cause in ((impact.mesh_loss, "mesh"), (impact.contact_loss, "contact")):
            if loss < -_ROUNDING * impact.kinetic - 1e-12:
                yield _energy(impact.time, -loss, f"impact, {cause}")


def _energy(time: float, size: float, cause: str) -> StepEvent:
    return StepEvent("energy", time, size, f"the step made {size:.3g} J ({cause})")
