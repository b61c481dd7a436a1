"""The closed loop as it is on robots: noisy sensors, late torques, motors of finite bandwidth.

`SensorNoise` stands between the plant and the controller, `TorqueLag` between the controller and
the plant; both work with any plant. `ClosedLoop` joins them with a `Plant` and takes one tick at a
time. Wrong efficiencies are no part of the loop: give the controller `with_wrong_efficiencies`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from math import exp, inf, pi
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, Ranged, must
from wbc.errors import SimulationError
from wbc.robot import Motion, Robot
from wbc.sim.plant import Plant
from wbc.sim.result import StepResult
from wbc.sim.step.tables import SimState


class TorqueController(Protocol):
    """What the loop needs of a controller: `wbc.control.Controller` is one."""

    def step(self, state: Any, references: Any = None, contacts: Any = None) -> Any:
        """Return the command for a measured state; its `rotor_torque` (m,) [N m] goes to drives."""


@dataclass(eq=False)
class SensorNoise(Ranged):
    """White noise on the measured state; the same seed gives the same bits.

    Attributes:
        robot: whose state is measured.
        position: standard deviation of every coordinate [m, rad]; on a free base along and about
            its own axes, so that its orientation stays one.
        velocity: standard deviation of every velocity [m/s, rad/s].
        seed: of the random numbers.
    """

    robot: Robot
    _: KW_ONLY
    position: float = field(default=0.0, metadata=must(">= 0 and < inf"))
    velocity: float = field(default=0.0, metadata=must(">= 0 and < inf"))
    seed: int = 0

    _told, _raised = "sensor noise: ", SimulationError

    def __post_init__(self) -> None:
        """Check, and start the random numbers."""
        super().__post_init__()
        self.reset()

    def reset(self) -> None:
        """Start the random numbers anew."""
        self._random = np.random.default_rng(self.seed)

    def __call__(self, state: Motion | SimState) -> Motion:
        """Return what the sensors show of a state."""
        position, velocity = state.position, state.velocity
        model = self.robot.model
        if self.position:
            moved = self.position * self._random.standard_normal(model.nv)
            position = pin.integrate(model, position, moved)
        if self.velocity:
            velocity = velocity + self.velocity * self._random.standard_normal(model.nv)
        return Motion(position, velocity)


@dataclass(eq=False, kw_only=True)
class TorqueLag(Ranged):
    """A dead time and a first-order lag between the commanded and the delivered torque.

    The delivered torque y follows the command u of `delay` earlier, tau dy/dt = u - y with
    tau = 1/(2 pi bandwidth). Commands are held between ticks, so that y and its mean over a step
    are exact, whatever the delay. Before the first call the drives held what it commands.

    Attributes:
        delay: dead time of the command [s].
        bandwidth: frequency [Hz] at which a sine comes out with 1/sqrt(2) of its amplitude;
            infinite for a motor that follows at once.
    """

    delay: float = field(default=0.0, metadata=must(">= 0 s and < inf"))
    bandwidth: float = field(default=inf, metadata=must("> 0 Hz"))

    _told, _raised = "torque lag: ", SimulationError

    def __post_init__(self) -> None:
        """Check, and forget every command."""
        super().__post_init__()
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
            self._torque, self._waiting = torque, [(self.delay, torque)]
        self._waiting.append((self.delay + time, torque))
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
        tau = 1.0 / (2.0 * pi * self.bandwidth)
        if self._torque is None or tau == 0.0:
            self._torque = command
            return command * length
        gap = self._torque - command
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


@dataclass(eq=False)
class ClosedLoop(Ranged):
    """A plant and a controller with what lies between them on a robot; the loop is the user's.

    With neither noise nor lag it is the ideal loop, to the last bit: `controller.step` on the true
    state and `plant.step` under its torque.

    Attributes:
        plant: what moves; its encoders sit on the motors (`Plant.encoders`).
        controller: anything with `step(state, references)` that returns rotor torques.
        noise: of the sensors, None for true states.
        lag: of the drives, None for torques that come at once.
        period: of the controller [s].
    """

    plant: Plant
    controller: TorqueController
    _: KW_ONLY
    noise: SensorNoise | None = None
    lag: TorqueLag | None = None
    period: float = field(default=1e-3, metadata=must("> 0 s"))

    _told, _raised = "closed loop: ", SimulationError

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
        seen = Motion(shown.position, shown.velocity) if self.noise is None else self.noise(shown)
        command = self.controller.step(seen, references, **options)
        torque = np.asarray(command.rotor_torque, dtype=np.float64)
        if self.lag is not None:
            torque = self.lag(torque, self.period)
        result = self.plant.step(state, torque, self.period, external)
        return LoopTick(seen, command, torque, result)

    def reset(self) -> None:
        """Start noise and lag anew, for a run with the same bits; the controller is the user's."""
        for part in (self.noise, self.lag):
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
