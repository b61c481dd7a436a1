"""What a step has to say beside its state: energy that it made, overlaps that are left."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.sim.energy.audit import EnergyAudit
from wbc.sim.ground.barriers import TOUCH
from wbc.sim.setup import Setup
from wbc.sim.step.flow import Flow
from wbc.sim.step.impact import Impact

_ROUNDING = 1e-8  # of the energy in play: laws hold to 1e-10 of the speeds
_COARSE = 0.01  # share of the energy in play


@dataclass(frozen=True, slots=True)
class StepEvent:
    """One thing that a user of a step should know.

    Attributes:
        kind: "energy", where contacts, stops or gears made energy, which no law allows; "coarse",
            where the step's energy balance gained more than a hundredth of the energy in play,
            which a shorter step mends; "overlap", where a barrier was overrun further than the
            plant's return speed takes back in one step; "sunk", where a joint of a robot with a
            free base is under the ground, because its link has no contact there.
        time: [s], at the end of the part it happened in.
        size: [J], or depth [m, rad].
        text: the same as a sentence.
    """

    kind: str
    time: float
    size: float
    text: str


def events_of(
    setup: Setup, parts: Sequence[Flow], impacts: Sequence[Impact], balance: EnergyAudit
) -> tuple[StepEvent, ...]:
    """Return what happened in the parts and impacts of a step with an energy `balance`."""
    found = [*_overlaps(setup, parts), *_made(parts, impacts), *_sunk(setup, parts[-1])]
    kinetic = [_kinetic(part) for part in parts]
    play = max(kinetic, default=0.0) + abs(balance.flow.work) + balance.flow.lost
    if -balance.residual > _COARSE * play + 1e-9:
        gain = -balance.residual
        found.append(
            StepEvent(
                "coarse",
                parts[-1].state.time,
                gain,
                f"the step is too long: of {play:.3g} J that it moved, {gain:.3g} J came from "
                "nowhere; shorten dt",
            )
        )
    return tuple(found)


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


def _sunk(setup: Setup, last: Flow) -> Iterator[StepEvent]:
    """Yield the deepest joint under the ground at the end of a step."""
    model, state, points = setup.robot.model, last.state, len(setup.robot.contacts)
    if not setup.bases or not points:
        return
    data = model.createData()
    pin.forwardKinematics(model, data, state.position)
    links = [i for i in range(1, model.njoints) if model.inertias[i].mass > 0.0]
    gaps = setup.barriers.gaps_of(np.array([data.oMi[i].translation for i in links]), state.time)
    deepest = int(np.argmin(gaps))
    # Contacts may be as deep as a step leaves them.
    allowed = max((float(np.max(last.overlap)) if len(last.overlap) else 0.0), TOUCH)
    if gaps[deepest] < -allowed:
        yield StepEvent(
            "sunk",
            state.time,
            -float(gaps[deepest]),
            f"joint '{model.names[links[deepest]]}' is {-gaps[deepest]:.3g} m under the ground: no "
            'contact holds its link. Give the robot contacts there, or the plant bodies="all"',
        )


def _made(parts: Sequence[Flow], impacts: Sequence[Impact]) -> Iterator[StepEvent]:
    """Yield the parts and impacts one of whose losses is negative beyond rounding."""
    for part in parts:
        losses = part.energy.losses
        normal = part.solution.reduced.normal_rows
        pushed = part.solution.impulse[normal] * part.solution.speed[normal]
        losses["normal"] = -float(pushed.max(initial=0.0))
        cause = min(losses, key=lambda name: losses[name])
        traffic = float(np.abs(part.solution.impulse) @ np.abs(part.solution.speed))
        if losses[cause] < -_ROUNDING * (_kinetic(part) + traffic) - 1e-12:
            yield _energy(part.state.time, -losses[cause], cause.replace("_", " "))
    for impact in impacts:
        program = impact.solution.reduced.program
        kinetic = 0.5 * float(impact.before @ program.inertia @ impact.before)
        for loss, cause in ((impact.mesh_loss, "mesh"), (impact.contact_loss, "contact")):
            if loss < -_ROUNDING * kinetic - 1e-12:
                yield _energy(impact.time, -loss, f"impact, {cause}")


def _energy(time: float, size: float, cause: str) -> StepEvent:
    return StepEvent("energy", time, size, f"the step made {size:.3g} J ({cause})")


def _kinetic(part: Flow) -> float:
    """Return twice a bound of the links' kinetic energy at the middle of a part [J]."""
    program, v = part.solution.reduced.program, part.transit.velocity
    inertia = np.abs(program.inertia.diagonal())
    return float(inertia @ (v * v + part.solution.velocity**2))
