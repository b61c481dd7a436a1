"""How far a simulated robot strays from its logs, started again and again from measured states."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque
from wbc.errors import LogError, SimulationError
from wbc.files import as_json
from wbc.identification.answer.shown import told
from wbc.identification.records.channels import contact_forces
from wbc.identification.records.drives import drive_law, sensors_as_reports
from wbc.identification.records.preparation import prepare
from wbc.identification.records.record import Record
from wbc.measurement import Log, cut_at_gaps
from wbc.robot import Motion, Robot
from wbc.robot.coordinates import unit_at
from wbc.tables import TextTable

if TYPE_CHECKING:
    from wbc.sim import SimState

_STEP = 2e-3  # [s]; with 1 ms the errors on the sample logs of the leg change by at most 4 %
_FAR = 1e6  # [m] below, so that no contact point finds ground: recorded forces act instead
HORIZONS = (0.1, 0.5, 2.0)
"""Times after the start at which positions are compared [s]."""

_STARTS = 12  # over all logs: an rms of as many independent errors is known within 20 %
_APART = 0.5  # [s] between starts at least; closer ones say the same


class SimulatedLog:
    """A robot that moves as one log tells its drives.

    Attributes:
        robot: with the drives and loads of this log.
        plant: of that robot, without joint limits and ground.
        laws: one per drive.
        time: (N,) of the log [s], from its start.
        rows: (N,) their numbers.
        forces: contact name -> (N, 3) [N] recorded.
        motion: smoothed states, on the clock of `states`.
        states: (M,) times of the states [s], from the log's start.
        first: where the smoothed states begin to be good [s].
        length: how long they are [s].
    """

    def __init__(self, robot: Robot, log: Log, record: Record) -> None:
        """Prepare a log and its smoothed record.

        Raises:
            LogError: the torque of a joint or the force of a contact is not known.
            SimulationError: a robot that cannot be simulated.
        """
        from wbc.sim import Plane, Plant  # the plant is loaded by whoever simulates

        own = robot if log.machine is None else log.machine.of(robot)
        gears = own.transmission
        unknown = [point.name for point in own.contacts if point.name not in log.contacts]
        if unknown and (own.floating_size or record.active):
            raise LogError(
                f"{log.source.label}: the forces at {', '.join(unknown)} were not recorded, and "
                "without them the robot cannot be simulated along the log."
            )
        endless = own.model.copy()  # a log may pass the limits of a drawing
        endless.lowerPositionLimit = np.full(endless.nq, -np.inf)
        endless.upperPositionLimit = np.full(endless.nq, np.inf)
        self.plant = Plant(replace(own, model=endless), Plane(height=-_FAR), bodies="feet")
        self.robot, self.time, self.rows = own, log.time - log.time[0], np.arange(len(log))
        self.laws = [drive_law(log, gears, k) for k in range(gears.size)]
        self.forces, self.motion = contact_forces(own, log), record.motion_of(own)
        self.states, edge = np.asarray(record.motion.time), record.edge / record.rate
        self.first = float(self.states[0]) + edge
        self.length = float(self.states[-1] - self.states[0]) - 2.0 * edge

    def missed(self, start: float, horizons: Sequence[float]) -> tuple[FloatArray, FloatArray]:
        """Return (j, h) simulated minus measured position, and the measured displacement.

        NaN beyond the end of the log; infinite where the simulation ended before.
        """
        first = int(np.searchsorted(self.states, start))
        begin = float(self.states[first])
        rows = [self.robot.position_index(name) for name in self.robot.single_joints]
        position = self.motion.position
        missed = np.full((len(rows), len(horizons)), np.nan)
        moved = missed.copy()
        state = self.plant.state(position[first], self.motion.velocity[first])
        for column, horizon in enumerate(horizons):
            end = begin + horizon
            if end > self.states[-1]:
                break
            there = np.array([np.interp(end, self.states, position[:, row]) for row in rows])
            moved[:, column] = there - position[first, rows]
            try:
                state = self._until(state, begin, horizon)
            except SimulationError:
                missed[:, column:] = np.inf
                break
            missed[:, column] = state.position[rows] - there
        return missed, moved

    def _until(self, state: SimState, begin: float, horizon: float) -> SimState:
        """Return the state at `horizon` [s] after `begin`; `state.time` counts from there."""
        while state.time < horizon - 1e-9:
            step, external = min(_STEP, horizon - state.time), None
            row = float(np.interp(begin + state.time + 0.5 * step, self.time, self.rows))
            if self.forces:
                forces = {name: force[int(row)][None] for name, force in self.forces.items()}
                external = contact_torque(self.robot, state.position[None], forces)[0]
            state = self.plant.step(state, self._command(state, row), step, external).state
            if not np.isfinite(state.position).all():
                raise SimulationError("the simulated motion leaves all numbers.")
        return state

    def _command(self, state: SimState, row: float) -> FloatArray:
        """Return the rotor torque (m,) that the drives make of what their encoders show.

        Between two rows a log says what a line through both does, as comparisons read it: a row
        that holds until the next one would be late by half of that time.
        """
        robot, seen = self.robot, self.plant.encoders(state)
        motion = Motion(seen.position, seen.velocity)
        for effect in robot.effects:
            motion = effect.measured(robot, motion)
        to_motor = robot.transmission.motor_from_joint
        angle = to_motor @ motion.position[robot.actuated_position]
        speed = to_motor @ motion.velocity[robot.actuated]
        share, rows = row % 1.0, (int(row), min(int(row) + 1, len(self.time) - 1))
        pairs = zip(self.laws, angle, speed, strict=True)
        each = np.array([[law.at(one, *seen) for one in rows] for law, *seen in pairs])
        return np.asarray(each @ [1.0 - share, share])


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """Position errors of a robot that was simulated from measured states.

    Attributes:
        joints: names of the joints with a position, j of them.
        units: of their positions, rad or m.
        horizons: times after a start [s], h of them.
        error: (j, h) rms of simulated minus measured position; NaN where the logs are too short,
            infinite where a simulation ended before.
        moved: (j, h) rms of how far the joint moved in that time: the error of a joint that stays.
        starts: (h,) how many starts each column holds.
        reason: why nothing could be simulated; empty if it could.
    """

    joints: tuple[str, ...]
    units: tuple[str, ...]
    horizons: tuple[float, ...]
    error: FloatArray
    moved: FloatArray
    starts: tuple[int, ...]
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        rows = zip(self.joints, self.units, self.error, self.moved, strict=True)
        joints = {joint: {"unit": u, "error": e, "moved": m} for joint, u, e, m in rows}
        known = {"horizons": self.horizons, "starts": self.starts, "reason": self.reason}
        return dict(as_json(known | {"joints": joints}))


def open_loop_rows(simulated: Sequence[OpenLoop]) -> TextTable:
    """Return position errors after each horizon: of one robot, or as given and with what was found.

    Beside them stands how far the joint moved in that time.
    """
    first, cells = simulated[0], []
    for row, (joint, unit) in enumerate(zip(first.joints, first.units, strict=True)):
        errors = []
        for k in range(len(first.horizons)):
            found = [told(one.error[row, k]) for one in simulated if not one.reason]
            # Two robots need two lines: three horizons of them are wider than a terminal.
            between = "\n" if len(found) > 1 else " "
            errors.append(f"{' -> '.join(found)}{between}of {told(first.moved[row, k])}")
        cells.append((joint, *errors, unit))
    return TextTable.of(
        "|".join(["open loop", *(f">after {horizon:g} s" for horizon in first.horizons), ""]),
        cells,
        caption="rms position error of the simulated robot so long after a measured state, of how "
        "far the joint moved",
    )


def open_loop(
    robot: Robot, logs: Sequence[Log], horizons: Sequence[float] = HORIZONS, until: float = inf
) -> OpenLoop:
    """Return how far `robot` strays from logs when it is simulated from their states.

    From starts spread evenly over the logs, the plant of `wbc.sim` runs with what the log says the
    drives were told: the recorded torque, or the law of the drive with the recorded target, which
    then sees the simulated motion. Forces at contacts are those recorded. A delay of targets
    (`actuation_delay`) delays the whole torque here, the drive's own measurement with it. Drives
    see the simulated motion at once, whatever their `feedback_delay` is.

    Args:
        robot: with its effects.
        logs: at least one.
        horizons: times after a start at which positions are compared [s].
        until: time [s] of the monotonic clock at which it must end.

    Returns:
        The errors; with `reason` and NaN where nothing can be simulated (contacts whose forces
        nobody recorded, a joint without torque, links without inertia), or not in time.

    Raises:
        IdentificationError: no log, or a log that lacks what the robot needs.
    """
    names = robot.single_joints
    table = np.full((len(names), len(horizons)), np.nan)
    nothing = OpenLoop(
        joints=names,
        units=tuple(unit_at(robot, name, "rad") for name in names),
        horizons=tuple(horizons),
        error=table,
        moved=table,
        starts=(0,) * len(horizons),
    )
    late = replace(nothing, reason="the time given was over before. `wbc compare` simulates them.")
    if time.monotonic() > until:
        return late
    pieces, _ = cut_at_gaps(logs)
    pieces = [sensors_as_reports(robot, piece) for piece in pieces]
    try:
        records = prepare(robot.without_effects().lossless(), pieces)
        pairs = zip(pieces, records, strict=True)
        simulated = [SimulatedLog(robot, log, record) for log, record in pairs]
    except (LogError, SimulationError) as error:
        return replace(nothing, reason=str(error))
    found = []
    for log, start in _starts(simulated, max(horizons)):
        if time.monotonic() > until:
            return late
        found.append(log.missed(start, horizons))
    if not found:
        reason = f"no log is longer than {min(horizons):g} s beside its ends."
        return replace(nothing, reason=reason)
    missed, moved = np.moveaxis(np.array(found), 1, 0)
    starts = tuple((~np.isnan(moved[:, 0])).sum(axis=0).tolist())
    return replace(nothing, error=_rms(missed), moved=_rms(moved), starts=starts)


def _starts(logs: Sequence[SimulatedLog], longest: float) -> list[tuple[SimulatedLog, float]]:
    """Return logs with times of their start [s], spread evenly over all that is long enough."""
    total = sum(log.length for log in logs)
    found = []
    for log in logs:
        room = max(log.length - longest, 0.0)
        wished = max(1, round(_STARTS * log.length / total)) if total > 0.0 else 0
        count = min(wished, 1 + int(room / _APART))
        found += [(log, log.first + room * (k + 0.5) / count) for k in range(count)]
    return found


def _rms(values: FloatArray) -> FloatArray:
    """Return the root mean square (j, h) of what is known of (starts, j, h)."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(np.nansum(values**2, axis=0) / (~np.isnan(values)).sum(axis=0)))
