"""How Solo12 trots: its gait and its controller; used by studies."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control import (
    Command,
    ContactSchedule,
    Controller,
    ControllerSettings,
    FrameOrientationTask,
    FramePositionTask,
    PointContact,
    PostureTask,
    Reference,
    RestPolicy,
    State,
    Task,
)
from wbc.robot import Robot

SPEED = 0.5  # [m/s] at which Solo12 trots
_PERIOD = 0.28  # [s] of a trot; with 0.36 it is 6 % slower than 0.5 m/s and sways a third more
_DUTY = 0.52  # share of it that a foot stands
_CLEARANCE = 0.05  # [m] of a swing over the higher of its two ends
_EARLY = 0.6  # share of a swing after which a foot that touches stands
_DOWN = 0.2  # [m/s] at which a foot that is late goes on down
_TOUCH = 1.5e-3  # [m] above the ground within which a foot counts as touching
_LEASH = 0.05  # [m] by which the place that the base is wanted at may lead
_RETURN = 2.0  # [1/s] with which footholds bring the base back to its place
_RISE = 0.1  # [s] in which the wanted height follows the ground


@dataclass(frozen=True)
class StepUp:
    """Level ground with one step up, across the way; as the robot knows it.

    Attributes:
        height: of the step [m]; 0 for level ground.
        edge: x [m] where it begins.
        margin: by how much footholds keep away from the edge [m].
    """

    height: float = 0.0
    edge: float = 0.6
    margin: float = 0.03

    def at(self, x: float) -> float:
        """Return the height of the ground [m] at x [m]."""
        return self.height if x > self.edge else 0.0

    def foothold(self, x: float) -> float:
        """Return the x [m] nearest to a given one that is not too close to the edge."""
        if self.height == 0.0 or abs(x - self.edge) > self.margin:
            return x
        return self.edge + (self.margin if x > self.edge else -self.margin)


@dataclass
class Swing:
    """A foot in the air.

    Attributes:
        start: where it left the ground (3,) [m].
        share: of the swing that is done, 0 to 1; beyond 1 the foot is late.
    """

    start: FloatArray
    share: float = 0.0


@dataclass
class Trotter:
    """The loop's controller for a trot along x of a robot with four point feet.

    Attributes:
        model: robot model that the controller obeys.
        pose: q (nq,) in which the feet stand below the hips.
        speed: of the base along x [m/s].
        ground: what it walks on.
        policy: what the controller does with the stiction of a gear at rest.
        tick: time between two calls [s].
        start: time [s] of standing before the trot.
    """

    model: Robot
    pose: FloatArray
    speed: float = SPEED
    ground: StepUp = field(default_factory=StepUp)
    policy: RestPolicy = RestPolicy.NEUTRAL
    tick: float = 1e-3
    start: float = 0.1
    commands: list[Command] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the schedule, the tasks and the controller."""
        self.feet = [contact.name for contact in self.model.contacts]
        self._frame = {c.name: self.model.model.getFrameId(c.frame) for c in self.model.contacts}
        self._data = self.model.model.createData()
        self._read(self.pose, np.zeros(self.model.model.nv))
        self._nominal = {name: self._foot(name) - self.pose[:3] for name in self.feet}
        self._sole = {name: float(self._foot(name)[2]) for name in self.feet}
        self._pair = {name: bool(x * y > 0.0) for name, (x, y, _) in self._nominal.items()}
        self._height = float(self.pose[2])
        self._gait = ContactSchedule(
            _PERIOD, {name: 0.0 if self._pair[name] else 0.5 for name in self.feet}, _DUTY
        )
        # a plan says who stands, and a foot's own place: nothing flickers
        settings = ControllerSettings(
            rest_policy=self.policy, time_step=self.tick, contact_ramp=0.0
        )
        points = [PointContact(name=name) for name in self.feet]
        self._controller = Controller(self.model, self._tasks(), points, settings=settings)
        self._wanted = np.array(self.pose[:3])
        self._swings: dict[str, Swing] = {}
        self._time = 0.0

    def _tasks(self) -> list[Task]:
        """Return the tasks of base, trunk, feet in the air and posture."""
        base = self.model.bodies[0]
        swings = [
            FramePositionTask(name=c.name, frame=c.frame, weight=30.0, stiffness=1500.0)
            for c in self.model.contacts
        ]
        return [
            FramePositionTask(name="height", frame=base, axes="z", weight=100.0, stiffness=200.0),
            FramePositionTask(name="travel", frame=base, axes="xy", weight=20.0, stiffness=20.0),
            FrameOrientationTask(name="trunk", frame=base, weight=10.0, stiffness=300.0),
            *swings,
            PostureTask.of(self.model, weight=1e-2, stiffness=10.0),
        ]

    def __call__(self, state: State) -> FloatArray:
        """Return the rotor torque for a state, one tick after the last call."""
        self._read(state.position, state.velocity)
        standing = self._phases()
        speed = self.speed if self._time >= self.start else 0.0
        references = self._base(state, speed)
        for name, swing in self._swings.items():
            references[name] = self._swing(name, swing, state, speed)
        activation = {name: float(name in self._swings) for name in self.feet}
        command = self._controller.step(
            state, references, dict.fromkeys(standing, np.inf), activation=activation
        )
        self.commands.append(command)
        self._time += self.tick
        return command.rotor_torque

    def _read(self, q: FloatArray, v: FloatArray) -> None:
        pin.forwardKinematics(self.model.model, self._data, q, v)
        pin.updateFramePlacements(self.model.model, self._data)

    def _foot(self, name: str) -> FloatArray:
        return np.array(self._data.oMf[self._frame[name]].translation)

    def _phases(self) -> list[str]:
        """Lift feet and put them down where due; return those that stand.

        A pair lifts only when the other one is down.
        """
        time = self._time - self.start
        standing = []
        for name in self.feet:
            share = self._gait.swing(name, time) if time >= 0.0 else None
            place = self._foot(name)
            swing = self._swings.get(name)
            others = any(self._pair[name] != self._pair[other] for other in self._swings)
            if share is not None and swing is None and share < _EARLY and not others:
                swing = self._swings[name] = Swing(place)
            if swing is not None:
                length = (1.0 - _DUTY) * _PERIOD
                swing.share = share if share is not None else swing.share + self.tick / length
                ground = self.ground.at(float(place[0])) + self._sole[name]
                touches = place[2] < ground + _TOUCH
                if swing.share > _EARLY and touches:
                    del self._swings[name]
                    swing = None
            if swing is None:
                standing.append(name)
        return standing

    def _base(self, state: State, speed: float) -> dict[str, Reference]:
        """Return what the base should do: ahead at the speed, level, at its height."""
        base = np.array(state.position[:3])
        self._wanted[0] += speed * self.tick
        self._wanted[:2] = base[:2] + np.clip(self._wanted[:2] - base[:2], -_LEASH, _LEASH)
        under = np.mean([self.ground.at(float(self._foot(name)[0])) for name in self.feet])
        level = self._height + under - self._wanted[2]
        self._wanted[2] += level * self.tick / _RISE
        return {
            "height": Reference(self._wanted[2:].copy()),
            "travel": Reference(self._wanted[:2].copy(), np.array([speed, 0.0])),
            "trunk": Reference(np.eye(3)),
        }

    def _swing(self, name: str, swing: Swing, state: State, speed: float) -> Reference:
        """Return where a foot in the air should be.

        The foothold is below the hip, ahead by half of what the hip travels in a stance, and
        further ahead where the base is faster than wanted (Raibert 1986, with sqrt(h/g) for his
        gain, which is the capture point's).
        """
        length = (1.0 - _DUTY) * _PERIOD
        turn = pin.Quaternion(state.position[3:7]).matrix()
        rate = (turn @ state.velocity[:3])[:2]
        yaw = np.arctan2(turn[1, 0], turn[0, 0])
        c, s = np.cos(yaw), np.sin(yaw)
        hip = state.position[:2] + np.array([[c, -s], [s, c]]) @ self._nominal[name][:2]
        left = max(1.0 - swing.share, 0.0) * length
        wanted = np.array([speed, 0.0]) + _RETURN * (self._wanted[:2] - state.position[:2])
        lead = np.sqrt(self._height / 9.81) * (rate - wanted)
        place = hip + rate * left + 0.5 * _DUTY * _PERIOD * rate + lead
        place[0] = self.ground.foothold(float(place[0]))
        end = np.array([*place, self.ground.at(float(place[0])) + self._sole[name]])
        late = swing.share - 1.0
        if late > 0.0:
            down = np.array([0.0, 0.0, _DOWN])
            return Reference(end - late * length * down, -down)
        path, slope, bend = minimum_jerk(swing.share)
        rise, climb, curve = hump(swing.share)
        top = max(swing.start[2], end[2]) + _CLEARANCE - 0.5 * (swing.start[2] + end[2])
        way, up = end - swing.start, np.array([0.0, 0.0, top])
        target = swing.start + path * way + rise * up
        return Reference(
            target, (slope * way + climb * up) / length, (bend * way + curve * up) / length**2
        )


def minimum_jerk(s: float) -> tuple[float, float, float]:
    """Return the quintic from 0 to 1, at rest at both ends, at s in [0, 1], and its two slopes."""
    return (
        s**3 * (10.0 - 15.0 * s + 6.0 * s * s),
        30.0 * s * s * (1.0 - s) ** 2,
        60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
    )


def hump(s: float) -> tuple[float, float, float]:
    """Return 16 s^2 (1 - s)^2, 1 at s = 0.5 and at rest at both ends, and its two slopes."""
    return (
        16.0 * (s * (1.0 - s)) ** 2,
        32.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
        32.0 * (1.0 - 6.0 * s + 6.0 * s * s),
    )
