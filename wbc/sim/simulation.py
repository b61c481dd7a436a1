"""Writing down what a plant does, in the columns of a log, and a loop that does it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.measurement import Log
from wbc.measurement.schema import FREE_POSE, FREE_VELOCITY
from wbc.parallel import progress_bar
from wbc.robot import Robot
from wbc.robot.model_file import driven_joints
from wbc.sim.energy import EnergyAudit, EnergyFlow
from wbc.sim.plant import Plant
from wbc.sim.result import Impact, StepEvent, StepResult
from wbc.sim.setup import Drivetrain
from wbc.sim.step.tables import SimState


class Recorder:
    """Collects steps; `log` returns them as a log of true values.

    A row holds the state at its time and the torques and forces of the step that starts there:
    `rotor_torque` as the drives report it, `joint_torque` what the gears pass to the joints, and
    contact forces as means over the step, impacts included. Where a gear is compliant or has play
    `rotor_position` and `rotor_velocity` stand beside the joint's own position and velocity.
    """

    def __init__(self, robot: Robot, temperature: FloatArray | None = None) -> None:
        """Prepare to record `robot`, and the temperature (m,) of its motors where it is known."""
        self._robot, self._temperature = robot, temperature
        self._drive = Drivetrain(robot)
        self._rows: list[tuple[float | FloatArray, ...]] = []

    def add(self, state: SimState, result: StepResult) -> None:
        """Record the step from `state` that gave `result`."""
        torque = self._robot.transmission.motor_from_joint.T @ result.mesh_torque
        force = result.contact_force[: len(self._robot.contacts)].ravel()
        turn = self._drive.rotors(state) if self._drive.any_loose else ()
        shown = state.time, state.position, state.velocity, result.command, torque, force
        self._rows.append((*shown, *turn))

    def log(self) -> Log:
        """Return everything recorded so far.

        Raises:
            SimulationError: fewer than two rows.
        """
        if len(self._rows) < 2:
            raise SimulationError("a recording needs at least two steps to be a log.")
        times, q, v, rotor, joint, force, *turn = map(np.array, zip(*self._rows, strict=True))
        robot, columns = self._robot, dict[str, FloatArray]()
        for owner, (at_q, at_v) in robot.free_flyers.items():
            columns |= {f"{owner}.{own}": q[:, at_q + i] for i, own in enumerate(FREE_POSE)}
            columns |= {f"{owner}.{own}": v[:, at_v + i] for i, own in enumerate(FREE_VELOCITY)}
        for name in driven_joints(robot.model):
            columns[f"{name}.position"] = q[:, robot.position_index(name)]
            columns[f"{name}.velocity"] = v[:, robot.velocity_index(name)]
        motors = {"rotor_torque": rotor, "joint_torque": joint}
        if self._temperature is not None:
            motors["temperature"] = np.tile(self._temperature, (len(times), 1))
        if turn:
            motors["rotor_position"], motors["rotor_velocity"] = turn
        for i, name in enumerate(robot.transmission.joints):
            columns |= {f"{name}.{quantity}": values[:, i] for quantity, values in motors.items()}
        forces = [f"{contact.name}.force.{axis}" for contact in robot.contacts for axis in "xyz"]
        columns |= dict(zip(forces, force.T, strict=True))
        return Log(times, columns)


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
