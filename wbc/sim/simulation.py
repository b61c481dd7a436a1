"""A convenience loop: controller, plant, recording. The user may just as well own the loop."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.measurement import Log
from wbc.progress import progress_bar
from wbc.sim.energy import EnergyAudit, EnergyFlow
from wbc.sim.plant import Plant
from wbc.sim.recorder import Recorder
from wbc.sim.result import StepEvent
from wbc.sim.state import SimState
from wbc.sim.step.stages import Impact

Controller = Callable[[SimState], FloatArray]
"""Takes the plant's state, returns the rotor torque (m,) [N m] to hold until the next tick."""


@dataclass(frozen=True, eq=False)
class Simulation:
    """A finished run.

    Attributes:
        log: the recording, true values.
        state: at the end.
        impacts: all that happened.
        events: what steps had to say: energy made, overlaps left (`StepEvent`).
        audit: where the energy went.
        unsettled: how many parts of steps and impacts ended passively, see `StepResult.unsettled`.
    """

    log: Log
    state: SimState
    impacts: tuple[Impact, ...]
    audit: EnergyAudit
    unsettled: int
    events: tuple[StepEvent, ...]

    @property
    def marks(self) -> dict[str, float]:
        """Label -> time [s] where events of a kind begin, for `wbc.view.write_playback`.

        Events of one kind that follow each other within two rows of the recording are one mark.
        """
        row = float(self.log.time[1] - self.log.time[0])
        found: dict[str, float] = {}
        last: dict[str, float] = {}
        for event in self.events:
            if event.time - last.get(event.kind, -np.inf) > 2.0 * row:
                found[f"{event.kind}: {event.text}"] = event.time
            last[event.kind] = event.time
        return found


def simulate(
    plant: Plant,
    controller: Controller,
    state: SimState,
    duration: float,
    *,
    dt: float = 1e-3,
    external: Callable[[SimState], FloatArray | None] | None = None,
    progress: str | None = None,
) -> Simulation:
    """Run `controller` on `plant` for `duration` seconds.

    Args:
        plant: what moves.
        controller: called every `dt` with the true state.
        state: where to start.
        duration: [s], rounded to whole ticks of `dt`.
        dt: control period and row spacing of the recording [s].
        external: generalised force (nv,) from outside as a function of the state.
        progress: text of a progress bar, None for none.

    Raises:
        SimulationError: fewer than two ticks, or a step without a unique solution.
    """
    ticks = round(duration / dt)
    if ticks < 2:
        raise SimulationError(
            f"{duration:g} s at dt = {dt:g} s is no run; at least two ticks are needed."
        )
    recorder = Recorder(plant.robot, plant.temperature)
    flow, unsettled, heat = EnergyFlow(), 0, 0.0
    copper = plant.robot.transmission.copper_loss
    impacts: list[Impact] = []
    events: list[StepEvent] = []
    before = plant.mechanical_energy(state)
    with nullcontext() if progress is None else progress_bar(progress) as watch:
        for tick in range(ticks):
            command = np.asarray(controller(state), dtype=np.float64)
            push = None if external is None else external(state)
            result = plant.step(state, command, dt, push)
            recorder.add(state, result)
            state = result.state
            flow = flow + result.energy
            heat += dt * float(copper @ np.square(result.command))
            impacts.extend(result.impacts)
            events.extend(result.events)
            unsettled += result.unsettled
            if watch and tick % 100 == 99:
                watch(tick + 1, ticks)
    audit = EnergyAudit(flow, plant.mechanical_energy(state) - before, heat)
    return Simulation(recorder.log(), state, tuple(impacts), audit, unsettled, tuple(events))
