"""The closed loop as it is on robots: noisy sensors, late torques, motors of finite bandwidth.

`SensorNoise` stands between the plant and the controller, `TorqueLag` between the controller and
the plant; both work with any plant. `ClosedLoop` joins them with a `Plant` and takes one tick at a
time. Wrong efficiencies are no part of the loop: give the controller `with_wrong_efficiencies`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, inf, pi
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.robot import Motion, Robot
from wbc.sim.plant import Plant
from wbc.sim.result import StepResult
from wbc.sim.step.tables import SimState


class TorqueSource(Protocol):
    """What a controller returns: `wbc.control.Command` is one."""

    @property
    def rotor_torque(self) -> FloatArray:
        """(m,) [N m] to command to the drives."""


class TorqueController(Protocol):
    """What the loop needs of a controller: `wbc.control.Controller` is one."""

    def step(self, state: Any, references: Any = None, contacts: Any = None) -> TorqueSource:
        """Return the command for a measured state."""


class SensorNoise:
    """White noise on the measured state; the same seed gives the same bits."""

    def __init__(
        self, robot: Robot, *, position: float = 0.0, velocity: float = 0.0, seed: int = 0
    ) -> None:
        """Set the noise up.

        Args:
            robot: whose state is measured.
            position: standard deviation of every coordinate [m, rad]; on a free base along and
                about its own axes, so that its orientation stays one.
            velocity: standard deviation of every velocity [m/s, rad/s].
            seed: of the random numbers.

        Raises:
            SimulationError: a deviation is negative or not finite.
        """
        self._model = robot.model
        self._position = _at_least_zero("position noise", position)
        self._velocity = _at_least_zero("velocity noise", velocity)
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        """Start the random numbers anew."""
        self._random = np.random.default_rng(self._seed)

    def __call__(self, state: Motion | SimState) -> Motion:
        """Return what the sensors show of a state."""
        position, velocity = state.position, state.velocity
        if self._position:
            moved = self._position * self._random.standard_normal(self._model.nv)
            position = pin.integrate(self._model, position, moved)
        if self._velocity:
            velocity = velocity + self._velocity * self._random.standard_normal(self._model.nv)
        return Motion(position, velocity)


class TorqueLag:
    """A dead time and a first-order lag between the commanded and the delivered torque.

    The delivered torque y follows the command u of `delay` earlier, tau dy/dt = u - y with
    tau = 1/(2 pi bandwidth). Commands are held between ticks, so that y and its mean over a step
    are exact, whatever the delay. Before the first call the drives held what it commands.
    """

    def __init__(self, *, delay: float = 0.0, bandwidth: float = inf) -> None:
        """Set the lag up.

        Args:
            delay: dead time of the command [s].
            bandwidth: frequency [Hz] at which a sine comes out with 1/sqrt(2) of its amplitude;
                infinite for a motor that follows at once.

        Raises:
            SimulationError: a negative delay, or a bandwidth that is not positive.
        """
        if not bandwidth > 0.0:
            raise SimulationError(f"the torque bandwidth must be positive [Hz], got {bandwidth}.")
        self._delay = _at_least_zero("delay of the command", delay)
        self._time_constant = 1.0 / (2.0 * pi * bandwidth)
        self.reset()

    def reset(self) -> None:
        """Forget every command."""
        self._waiting: list[tuple[float, FloatArray]] = []  # until when [s] from now it acts
        self._torque: FloatArray | None = None

    def __call__(self, torque: FloatArray, time: float) -> FloatArray:
        """Return the mean delivered torque (m,) [N m] over the next `time` [s].

        Args:
            torque: (m,) [N m], commanded now and held for `time`.
            time: [s] until the next call.
        """
        if not time > 0.0:
            raise SimulationError(f"the time until the next command must be positive, got {time}.")
        torque = np.array(torque, dtype=np.float64)
        if self._torque is None:
            self._torque, self._waiting = torque, [(self._delay, torque)]
        self._waiting.append((self._delay + time, torque))
        total, now = np.zeros_like(torque), 0.0
        for until, command in self._waiting:
            length = min(until, time) - now
            if length > 0.0:
                total, now = total + self._follow(command, length), now + length
        # A sum of floating-point times may leave a sliver of a command that has acted already.
        spent = 1e-9 * time
        self._waiting = [(u - time, c) for u, c in self._waiting if u - time > spent]
        return total / time

    def _follow(self, command: FloatArray, length: float) -> FloatArray:
        """Follow a constant command for `length` [s]; return the delivered impulse [N m s]."""
        if self._torque is None or self._time_constant == 0.0:
            self._torque = command
            return command * length
        tau, gap = self._time_constant, self._torque - command
        left = exp(-length / tau)
        self._torque = command + left * gap
        return np.asarray(command * length + gap * tau * (1.0 - left))


@dataclass(frozen=True, eq=False)
class LoopTick:
    """One tick of a closed loop.

    Attributes:
        seen: the state as measured, which the controller was given.
        command: what the controller returned.
        torque: (m,) [N m] that the drives were left to deliver, mean over the tick.
        result: the plant's step under that torque; its state is the next one.
    """

    seen: Motion
    command: Any
    torque: FloatArray
    result: StepResult

    @property
    def state(self) -> SimState:
        """The next true state."""
        return self.result.state


class ClosedLoop:
    """A plant and a controller with what lies between them on a robot; the loop is the user's.

    With neither noise nor lag it is the ideal loop, to the last bit: `controller.step` on the true
    state and `plant.step` under its torque.
    """

    def __init__(
        self,
        plant: Plant,
        controller: TorqueController,
        *,
        noise: SensorNoise | None = None,
        lag: TorqueLag | None = None,
        period: float = 1e-3,
    ) -> None:
        """Join the parts.

        Args:
            plant: what moves; its encoders sit on the motors (`Plant.encoders`).
            controller: anything with `step(state, references)` that returns rotor torques.
            noise: of the sensors, None for true states.
            lag: of the drives, None for torques that come at once.
            period: of the controller [s].

        Raises:
            SimulationError: a period that is not positive.
        """
        if not period > 0.0:
            raise SimulationError(f"a closed loop needs a positive period, got {period} s.")
        self.plant, self.controller, self.period = plant, controller, period
        self._noise, self._lag = noise, lag

    def step(
        self,
        state: SimState,
        references: Mapping[str, Any] | None = None,
        *,
        external: FloatArray | None = None,
        **options: Any,
    ) -> LoopTick:
        """Measure, control and move for one period.

        Args:
            state: true state at the start.
            references: for the controller, as are `options` (its active contacts, say).
            external: generalised force (nv,) on the plant from outside.

        Raises:
            SimulationError: the plant cannot take the step.
        """
        shown = self.plant.encoders(state)
        seen = Motion(shown.position, shown.velocity) if self._noise is None else self._noise(shown)
        command = self.controller.step(seen, references, **options)
        torque = np.asarray(command.rotor_torque, dtype=np.float64)
        if self._lag is not None:
            torque = self._lag(torque, self.period)
        result = self.plant.step(state, torque, self.period, external)
        return LoopTick(seen, command, torque, result)

    def reset(self) -> None:
        """Start noise and lag anew, for a run with the same bits; the controller is the user's."""
        for part in (self._noise, self._lag):
            if part is not None:
                part.reset()


def with_wrong_efficiencies(robot: Robot, share: float) -> Robot:
    """Return the robot as somebody believes it whose efficiencies are off by a share.

    Args:
        robot: the true one.
        share: of both efficiencies of every gear; 0.1 makes 0.8 into 0.88. What would pass 1 is 1.

    Raises:
        SimulationError: a share that leaves no efficiency (-1 or less).
    """
    if not -1.0 < share < inf:
        raise SimulationError(f"efficiencies cannot be off by {share:g} of themselves.")
    gears = robot.transmission
    changed = {
        name: np.minimum((1.0 + share) * getattr(gears, name), 1.0)
        for name in ("forward_efficiency", "backward_efficiency")
    }
    return robot.with_transmission(gears.replace(**changed))


def _at_least_zero(name: str, value: float) -> float:
    if not 0.0 <= value < inf:
        raise SimulationError(f"the {name} must be zero or more and finite, got {value}.")
    return value
