"""Logs of a fixed-base robot that tracks a multi-sine: what a user records to learn its flaws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.measurement import Log
from wbc.robot import Effect, Robot
from wbc.sim.ground import Plane
from wbc.sim.plant import Plant
from wbc.sim.sensors import Sensor, SensorModel
from wbc.sim.simulation import Recorder
from wbc.sim.step.tables import SimState

_TICK = 1e-3  # [s] of the control loop, and between rows of the recording

ENCODER = SensorModel(
    position=Sensor(noise=2e-5, resolution=2.0 * np.pi / 2**18),
    velocity=Sensor(noise=3e-3),
    rotor_torque=Sensor(noise=2e-3, delay=0.5e-3),  # the mean of two periods of the drive
    every=2,
)


class MultiSine:
    """A smooth excitation of every joint about the robot's usual pose."""

    def __init__(self, robot: Robot, seed: int, size: float = 0.9) -> None:
        """Draw frequencies, sizes and phases; `size` [rad] is the sum of a joint's amplitudes."""
        random = np.random.default_rng(seed)
        n = robot.transmission.size
        self.omega = 2.0 * np.pi * random.uniform(0.15, 1.5, (n, 4))
        amplitude = random.uniform(0.5, 1.0, (n, 4)) / self.omega**0.5
        self.amplitude = size * amplitude / amplitude.sum(axis=1, keepdims=True)
        self.phase = random.uniform(0.0, 2.0 * np.pi, (n, 4))
        self.center = robot.pose()[robot.actuated_position]

    def at(self, time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and accelerations (m,) at a time [s]."""
        angle = self.omega * time + self.phase
        sine, cosine = self.amplitude * np.sin(angle), self.amplitude * np.cos(angle)
        position = self.center + sine.sum(axis=1)
        return position, (self.omega * cosine).sum(axis=1), -(self.omega**2 * sine).sum(axis=1)


def record_run(
    robot: Robot, believed: Robot, seed: int, duration: float, temperature: FloatArray | None = None
) -> Log:
    """Return the recording of one run: computed torque of the believed robot plus PD.

    The PD loop closes over encoders on the motors, as on most robots: over those of the links it
    would shake a soft gear without end. `temperature` (m,) is that of the motors [deg C].

    Raises:
        SimulationError: shorter than two ticks, or a step without a unique solution.
    """
    path, gears = MultiSine(believed, seed), believed.transmission
    model, data = believed.model, believed.model.createData()

    def control(state: SimState) -> FloatArray:
        q, v, a = path.at(state.time)
        state = plant.encoders(state)
        torque = pin.rnea(model, data, q, v, a) + gears.reflected_inertia * a
        torque += 150.0 * (q - state.position) + 8.0 * (v - state.velocity)
        return np.asarray(torque / gears.gear_ratio)

    far = Plane(height=-10.0)  # the leg swings free, its ground out of reach
    plant = Plant(robot, far, temperature=temperature, bodies="feet")
    q, v, _ = path.at(0.0)
    state, recorder = plant.state(q, v), Recorder(robot, plant.temperature)
    for _ in range(round(duration / _TICK)):
        result = plant.step(state, control(state), _TICK)
        recorder.add(state, result)
        state = result.state
    return recorder.log()


def record_with(
    believed: Robot, effects: Sequence[Effect], seed: int = 7, duration: float = 6.0
) -> tuple[Log, ...]:
    """Return three logs at 500 Hz of a robot with hidden effects: a run, its repeat, another run.

    Args:
        believed: fixed-base robot with serial gears, as the user knows it.
        effects: what it has besides.
        seed: of excitation and sensor noise.
        duration: of each run [s].
    """
    real = believed.with_effects(*effects)
    first = record_run(real, believed, seed, duration)
    other = record_run(real, believed, seed + 1, duration)
    runs = enumerate((first, first, other))  # the noise differs between a run and its repeat
    return tuple(ENCODER.measure(real, run, seed + k) for k, run in runs)
