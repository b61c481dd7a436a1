"""A planar leg that hops on the spot: height plan in stance, foot placement in the air."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.interpolate import BPoly

from wbc.arrays import FloatArray
from wbc.control import (
    CenterOfMassTask,
    Command,
    Controller,
    FramePositionTask,
    PointContact,
    PointFootBalanceTask,
    Reference,
    State,
)
from wbc.robot import Robot
from wbc.sim import SensorNoise, SimState

_G = 9.81
_TUCK = 0.02  # [m] by which the leg is shorter in the air than at take-off
_LEAN = 0.015  # [m/rad] by which the foot is placed under a leaning base
_BANDWIDTH = 5.0  # [1/s] of the balance: above sqrt(g/z), for stance has to bear the flight too
_LIFTED = 0.04  # [s] after take-off before a touch counts as a landing


class Motion(NamedTuple):
    """Centre of mass (3,), its velocity (3,), angular momentum about it (+y), foot (3,)."""

    com: FloatArray
    rate: FloatArray
    spin: float
    foot: FloatArray


@dataclass
class Hopper:
    """The loop's controller for a number of hops, after which the leg stands.

    One controller and three tasks do all: in the air the height and balance of the centre of mass
    are out of anyone's hands and cost a constant, on the ground the foot is.

    Attributes:
        model: robot model that the controller obeys.
        hops: how many.
        rise: of the centre of mass from take-off to apex [m].
        stance: time on the ground [s].
        noise: standard deviation of the measured velocities [m/s, rad/s].
        seed: of the noise.
        commands: what every tick returned.
        landed, apexes: time [s] of every landing; height [m] of the centre of mass at every apex.
    """

    model: Robot
    hops: int = 10
    rise: float = 0.04
    stance: float = 0.3
    noise: float = 0.01
    seed: int = 1
    commands: list[Command] = field(default_factory=list)
    landed: list[float] = field(default_factory=list)
    apexes: list[float] = field(default_factory=list)
    height: float = 0.0
    airborne: bool = False

    def __post_init__(self) -> None:
        """Make the controller."""
        tasks = [
            CenterOfMassTask(
                name="height",
                axes="z",
                weight=100.0,
                stiffness=400.0,
                acceleration_limit=np.inf,
            ),
            PointFootBalanceTask(contact="foot", frame="base", weight=100.0, bandwidth=_BANDWIDTH),
            FramePositionTask(name="foot", frame="foot", axes="xz", weight=100.0, stiffness=900.0),
        ]
        self._controller = Controller(self.model, tasks, [PointContact(name="foot")])
        self._data = self.model.model.createData()
        self._mass = pin.computeTotalMass(self.model.model)
        self._noise = SensorNoise(self.model, velocity=self.noise, seed=self.seed)
        self._since: float | None = None

    def __call__(self, state: SimState) -> FloatArray:
        """Return the rotor torque for a state."""
        seen = self._noise(state)
        motion = self._motion(seen)
        since = self._phase(state.time, motion)
        references = {"balance": Reference(0.0)}
        if self.airborne:
            pitch = float(seen.position[self.model.position_index("base_pitch")])
            references["foot"] = self._placement(motion, pitch)
            self.apexes[-1] = max(self.apexes[-1], float(motion.com[2]))
        else:
            at = min(since, self.stance)
            references["height"] = Reference(*(np.array([part(at)]) for part in self._plan))
        contacts = {} if self.airborne else {"foot": np.inf}
        command = self._controller.step(seen, references, contacts)
        self.commands.append(command)
        return command.rotor_torque

    def _motion(self, state: State) -> Motion:
        model, data = self.model.model, self._data
        momentum = pin.computeCentroidalMomentum(model, data, state.position, state.velocity)
        foot = pin.updateFramePlacement(model, data, model.getFrameId("foot")).translation
        return Motion(data.com[0], data.vcom[0], float(momentum.angular[1]), foot)

    def _phase(self, time: float, motion: Motion) -> float:
        """Switch between ground and air where due; return the time since [s]."""
        if self._since is None:
            self.height = float(motion.com[2] - motion.foot[2])
            self._begin_stance(time, motion)
        elif self.airborne and time - self._since > _LIFTED and motion.foot[2] < 1e-5:
            self.landed.append(time)
            self._begin_stance(time, motion)
        elif (
            not self.airborne
            and len(self.landed) < self.hops
            and time - self._since > self.stance - 1e-9
        ):
            self.airborne, self._since = True, time
            self.apexes.append(0.0)
        return time - (self._since or 0.0)

    def _begin_stance(self, time: float, motion: Motion) -> None:
        """Plan the height from what the landing left to take-off, or to standing at the end."""
        self.airborne, self._since = False, time
        last = len(self.landed) >= self.hops
        end = [self.height, 0.0 if last else sqrt(2.0 * _G * self.rise), 0.0 if last else -0.5 * _G]
        start = [motion.com[2] - motion.foot[2], motion.rate[2], 0.0]
        plan = BPoly.from_derivatives([0.0, self.stance], [start, end])
        self._plan = (plan, plan.derivative(), plan.derivative(2))

    def _placement(self, motion: Motion, pitch: float) -> Reference:
        """Return where the foot should be, carried along with the centre of mass.

        Over one hop the ground's force averages m g, so that a foot placed off the centre by d
        turns the robot by m g d per second: d = L / (m g (stance + flight)) takes away the
        angular momentum L = m z xd + k about the point of landing.
        """
        hop = self.stance + 2.0 * sqrt(2.0 * self.rise / _G)
        turning = self._mass * self.height * motion.rate[0] + motion.spin
        ahead = turning / (self._mass * _G * hop) + _LEAN * pitch
        return Reference(
            motion.com[[0, 2]] + np.array([ahead, _TUCK - self.height]),
            motion.rate[[0, 2]],
            np.array([0.0, -_G]),
        )
