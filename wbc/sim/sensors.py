"""What sensors make of a recording: noise, quantisation, bias, delay and a lower rate."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from wbc.arrays import FloatArray, Ranged, must
from wbc.errors import SimulationError
from wbc.measurement import Log
from wbc.robot import Motion, Robot

_ROTOR = ("rotor_position", "rotor_velocity")


@dataclass(frozen=True)
class Sensor(Ranged):
    """One kind of channel.

    Attributes:
        noise: standard deviation of white noise, in the channel's unit.
        resolution: quantisation step, zero for none.
        bias: added to every sample.
        delay: [s] by which the reading lags behind.
    """

    noise: float = field(default=0.0, metadata=must(">= 0 and < inf"))
    resolution: float = field(default=0.0, metadata=must(">= 0 and < inf"))
    bias: float = field(default=0.0, metadata=must("> -inf and < inf"))
    delay: float = field(default=0.0, metadata=must(">= 0 and < inf"))

    _told, _raised = "sensor ", SimulationError

    def read(self, time: FloatArray, values: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return what the sensor reports for true values (N,) at times (N,) [s].

        Noise comes before quantisation; before the first sample the reading is the first value.
        """
        seen = np.interp(time - self.delay, time, values) if self.delay else np.array(values)
        seen = seen + self.bias + self.noise * random.standard_normal(len(seen))
        if self.resolution:
            seen = self.resolution * np.round(seen / self.resolution)
        return np.asarray(seen)


@dataclass(frozen=True)
class SensorModel(Ranged):
    """The sensors of a robot: one `Sensor` per quantity.

    Attributes:
        position: of the joints.
        velocity: of the joints.
        rotor_torque: as the drives report it.
        joint_torque: behind the gears; None where no sensor is there, as on most robots.
        force: of the contacts, each axis.
        every: rows of the recording per row of the log (its rate).
    """

    position: Sensor = field(default_factory=Sensor)
    velocity: Sensor = field(default_factory=Sensor)
    rotor_torque: Sensor = field(default_factory=Sensor)
    joint_torque: Sensor | None = None
    force: Sensor = field(default_factory=Sensor)
    every: int = field(default=1, metadata=must(">= 1"))

    _told, _raised = "sensors: ", SimulationError

    def measure(self, robot: Robot, recording: Log, seed: int) -> Log:
        """Return the log that these sensors make of a recording; same seed, same bits.

        Encoders sit on the motors: in a gear that is compliant or has play they show the motor's
        motion. The robot's own effects on measurements (position offsets and the like) act first.
        """
        random = np.random.default_rng(seed)
        shown = reported_motion(robot, recording) | reported_forces(robot, recording)
        columns = {}
        for name, values in recording.columns.items():
            if name.endswith(_ROTOR):  # an encoder on it is what `position` comes from
                continue
            if name.endswith(".joint_torque") and self.joint_torque is None:
                continue
            given = shown.get(name, values)
            columns[name] = self._sensor(name).read(recording.time, given, random)
        measured = Log(recording.time, columns, recording.source)
        return measured[:: self.every]

    def _sensor(self, column: str) -> Sensor:
        for part in fields(self):
            value = getattr(self, part.name)
            if isinstance(value, Sensor) and f".{part.name}" in column:
                return value
        return Sensor()


def reported_motion(robot: Robot, recording: Log) -> dict[str, FloatArray]:
    """Return the joint columns as the encoders, on the motors, and the effects report them.

    Empty where both leave them as they are.
    """
    names = [j for j in robot.single_joints if recording.has(f"{j}.position", f"{j}.velocity")]
    gears = robot.transmission
    loose = recording.has(*(f"{joint}.{name}" for joint in gears.joints for name in _ROTOR))
    if not names or not (robot.effects or loose):
        return {}
    q = np.tile(robot.neutral(), (len(recording), 1))
    v = np.zeros((len(recording), robot.model.nv))
    at_q, at_v = [*map(robot.position_index, names)], [*map(robot.velocity_index, names)]
    q[:, at_q], v[:, at_v] = (recording.stack(part, names) for part in ("position", "velocity"))
    if loose:
        angle, speed = (recording.stack(name, gears.joints) for name in _ROTOR)
        q[:, robot.actuated_position] = gears.joints_from_rotors(angle)
        v[:, robot.actuated] = gears.joints_from_rotors(speed)
    motion = Motion(q, v, time=recording.time)
    for effect in robot.effects:
        motion = effect.measured(robot, motion)
    seen = {"position": motion.position[:, at_q], "velocity": motion.velocity[:, at_v]}
    return {f"{n}.{part}": seen[part][:, k] for part in seen for k, n in enumerate(names)}


def reported_forces(robot: Robot, recording: Log) -> dict[str, FloatArray]:
    """Return the force columns that sensors with a gain of their own report otherwise."""
    gains = {f"{c.name}.force.{axis}": c.sensor_gain for c in robot.contacts for axis in "xyz"}
    return {
        name: gain * recording.column(name)
        for name, gain in gains.items()
        if gain != 1.0 and recording.has(name)
    }
