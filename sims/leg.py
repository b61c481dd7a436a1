"""A planar leg that balances on its point foot, in the air and on the ground; used by studies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, pi, sin

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

from wbc.arrays import FloatArray
from wbc.control import (
    CenterOfMassTask,
    Command,
    Controller,
    ControllerSettings,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
)
from wbc.dynamics import evaluate
from wbc.robot import Robot
from wbc.sim import SensorNoise, SimState
from wbc.transmission import wedge_backward_efficiency

_BEND = 2.0  # [rad] to either side of 0, in which a balanced hip angle is looked for
_CUSHION = 6.0  # [1/s] at which the leg gives way after touching down

HeightReference = Callable[[float], FloatArray]
"""Time [s] -> height, its rate and its acceleration (3,) [m, m/s, m/s^2]."""


def with_gears(robot: Robot, efficiency: float | None = None, ratio: float | None = None) -> Robot:
    """Return the leg with all gears of one forward efficiency (wedge) or one ratio."""
    gears, one = robot.transmission, np.ones(robot.transmission.size)
    if efficiency is not None:
        backward = float(wedge_backward_efficiency(efficiency))
        changes = {"forward_efficiency": efficiency * one, "backward_efficiency": backward * one}
        gears = gears.replace(**changes)
    if ratio is not None:
        gears = gears.replace(gear_ratio=ratio * one)
    return robot.with_transmission(gears)


def balanced_pose(robot: Robot, lift: float = 0.0, knee: float = 0.7) -> FloatArray:
    """Return a pose with the centre of mass over the foot.

    Args:
        robot: a planar leg with joints `base_z`, `hip` and `knee`.
        lift: height of the foot above the ground [m].
        knee: its angle [rad].
    """
    pose, rest = robot.configuration(knee=knee), np.zeros(robot.model.nv)
    hip, height = int(robot.actuated_position[0]), robot.position_index("base_z")

    def overhang(angle: float) -> float:
        pose[hip] = angle
        terms = evaluate(robot, pose, rest)
        return float(terms.center_of_mass[0] - terms.contact_position[0, 0])

    angles = np.linspace(-_BEND, _BEND, 81)
    signs = np.sign([overhang(angle) for angle in angles])
    changes = np.flatnonzero(signs[1:] != signs[:-1])
    nearest = changes[np.argmin(np.abs(angles[changes]))]
    pose[hip] = brentq(overhang, angles[nearest], angles[nearest + 1])
    pose[height] += lift - float(evaluate(robot, pose, rest).contact_position[0, 2])
    return pose


def stance_controller(robot: Robot, settings: ControllerSettings | None = None) -> Controller:
    """Return the controller of height, balance and posture on a point foot that obeys `robot`."""
    tasks = [
        CenterOfMassTask(
            name="height", axes="z", weight=100.0, stiffness=400.0, acceleration_limit=np.inf
        ),
        PointFootBalanceTask(contact="foot", frame="base", weight=100.0),
        PostureTask.of(robot, weight=1e-3),
    ]
    return Controller(robot, tasks, [PointContact(name="foot")], settings=settings)


def stance_references(height: FloatArray) -> dict[str, Reference]:
    """Return what that controller is asked for at a height with its two rates (3,)."""
    wanted = Reference(height[:1], height[1:2], height[2:])
    return {"height": wanted, "balance": Reference(0.0)}


def cushion(gap: float, rate: float, time: float) -> FloatArray:
    """Return what is left of a gap after a time, its rate and acceleration (3,) [m, s].

    It dies away critically damped, as a leg gives way after it has touched down.
    """
    w = _CUSHION
    slope = rate + w * gap
    left = gap + slope * time
    motion = np.array([left, slope - w * left, w * (w * left - 2.0 * slope)])
    return np.asarray(np.exp(-w * time) * motion)


def standing_torque(robot: Robot, q: FloatArray) -> FloatArray:
    """Return the torque (m,) [N m] that leaves each gear while the leg stands in pose q."""
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    weight = np.array([0.0, 0.0, terms.bias[robot.velocity_index("base_z")]])
    joint = terms.bias - terms.contact_jacobian.T @ weight
    return np.asarray(robot.transmission.topology.T @ joint[robot.actuated])


def squat(height: float, amplitude: float, frequency: float, start: float = 0.0) -> HeightReference:
    """Return a height of the centre of mass that goes down and up as a cosine from `start` on."""

    w = 2.0 * pi * frequency

    def at(time: float) -> FloatArray:
        if time < start:
            return np.array([height, 0.0, 0.0])
        near, far = amplitude * cos(w * (time - start)), amplitude * sin(w * (time - start))
        return np.array([height - amplitude + near, -w * far, -w * w * near])

    return at


@dataclass
class LegControl:
    """The loop's controller: posture in the air, height and balance once the foot has touched.

    Attributes:
        model: robot model that the controller obeys.
        height: reference of the centre of mass over time since the foot touched.
        noise: standard deviation of the measured velocities [m/s, rad/s].
        commands: what every tick returned.
        errors: rows of height [m], sway [m] and pitch [rad] error, one per tick in stance.
    """

    model: Robot
    height: HeightReference
    noise: float = 0.02
    commands: list[Command] = field(default_factory=list)
    errors: list[tuple[float, float, float]] = field(default_factory=list)
    touched: float | None = None

    def __post_init__(self) -> None:
        """Make the two controllers."""
        self._stance = stance_controller(self.model)
        self._air = Controller(self.model, [PostureTask.of(self.model, stiffness=900.0)])
        self._noise = SensorNoise(self.model, velocity=self.noise, seed=1)
        self._landing = 0.0, 0.0
        self._frame = self.model.model.getFrameId("foot")
        self._pitch = self.model.position_index("base_pitch")
        self._data = self.model.model.createData()

    def _cushioned(self, time: float) -> FloatArray:
        """Return the height reference plus the landing's own motion, critically damped away."""
        return self.height(time) + cushion(*self._landing, time)

    def __call__(self, state: SimState) -> FloatArray:
        """Return the rotor torque for a state."""
        model = self.model.model
        # Lists of three numbers: an index into an array takes longer than its share of the tick.
        com = pin.centerOfMass(model, self._data, state.position).tolist()
        foot = pin.updateFramePlacement(model, self._data, self._frame).translation.tolist()
        if self.touched is None and foot[2] < 1e-5:
            self.touched = state.time
            jacobian = pin.jacobianCenterOfMass(model, self._data, state.position)
            start = self.height(0.0)
            speed = float(jacobian[2] @ state.velocity)
            self._landing = com[2] - float(start[0]), speed - float(start[1])
        seen = self._noise(state) if self.noise else state
        if self.touched is None:
            command = self._air.step(seen)
        else:
            height = self._cushioned(state.time - self.touched)
            command = self._stance.step(seen, stance_references(height))
            pitch = float(state.position[self._pitch])
            self.errors.append((com[2] - float(height[0]), com[0] - foot[0], pitch))
        self.commands.append(command)
        return command.rotor_torque
