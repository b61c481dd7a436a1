"""Planned motions: windowed Fourier series (Swevers et al. 1997) and the limits that they keep."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.design.experiment.rivals import Predictions, Rivals
from wbc.errors import DesignError
from wbc.measurement import Log, save_log
from wbc.robot import Motion, Robot
from wbc.robot.body_contacts import collision_solids

Course = tuple[FloatArray, FloatArray, FloatArray]
"""Positions, velocities and accelerations of driven joints, each (N, m)."""
_RAMP = 0.1  # share of the duration over which the window opens, and closes
ROOM = 0.8
"""Share of the limits that a motion may use: room for what the rivals do not know."""
SEARCH_RATE = 50.0
"""[Hz] at which motions are compared; odds are given at the rate of the log."""


@dataclass(frozen=True, eq=False)
class FourierPath:
    """q(t) = center + w(t) sum_k [s_k sin(k omega t) + c_k cos(k omega t)] of every driven joint.

    The window w rises from 0 to 1 and falls back with continuous second derivative, so that the
    robot starts and ends at rest in `center`.

    Attributes:
        center: (m,) [rad, m].
        sine, cosine: (m, K) [rad, m].
        frequency: of the first harmonic [Hz].
        duration: [s].
    """

    center: FloatArray
    sine: FloatArray
    cosine: FloatArray
    frequency: float
    duration: float

    def __post_init__(self) -> None:
        """Check sizes."""
        if self.sine.shape != self.cosine.shape or len(self.sine) != len(self.center):
            raise DesignError("a path needs as many sines as cosines, one row per joint.")
        if not (self.frequency > 0.0 and self.duration > 0.0):
            raise DesignError("frequency and duration of a path must be > 0.")

    def at(self, time: FloatArray) -> Course:
        """Return positions, velocities and accelerations (N, m) at times (N,) [s]."""
        order = 2.0 * np.pi * self.frequency * np.arange(1, self.sine.shape[1] + 1)
        angle = time[:, None] * order
        sin, cos = np.sin(angle), np.cos(angle)
        wave = sin @ self.sine.T + cos @ self.cosine.T
        rate = (cos * order) @ self.sine.T - (sin * order) @ self.cosine.T
        bend = -(sin * order**2) @ self.sine.T - (cos * order**2) @ self.cosine.T
        w, w1, w2 = (part[:, None] for part in self._window(time))
        position = self.center + w * wave
        return position, w * rate + w1 * wave, w * bend + 2.0 * w1 * rate + w2 * wave

    def scaled(self, share: float | FloatArray) -> FourierPath:
        """Return the path with all amplitudes multiplied by `share`, one or one per joint (m,)."""
        rows = np.broadcast_to(share, self.center.shape)[:, None]
        return replace(self, sine=rows * self.sine, cosine=rows * self.cosine)

    def times(self, rate: float) -> FloatArray:
        """Return the times (N,) [s] of samples at `rate` [Hz], both ends included."""
        return np.arange(round(self.duration * rate) + 1) / rate

    def _window(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the window and its two derivatives (N,): a quintic step up and down."""
        ramp = _RAMP * self.duration
        rising = time <= 0.5 * self.duration
        s = np.clip(np.where(rising, time, self.duration - time) / ramp, 0.0, 1.0)
        sign = np.where(rising, 1.0, -1.0)
        w = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        w1 = sign * 30.0 * s**2 * (1.0 - s) ** 2 / ramp
        w2 = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / ramp**2
        return w, w1, w2


def write_set_points(name: str | Path, robot: Robot, path: FourierPath, rate: float) -> Path:
    """Write a path as a log of set points: position, velocity and acceleration of driven joints.

    Args:
        name: of the file; its ending says the format, as in `wbc.measurement.save_log`.
        robot: whose driven joints move.
        path: of them.
        rate: rows per second [Hz].
    """
    time = path.times(rate)
    parts = list(zip(("position", "velocity", "acceleration"), path.at(time), strict=True))
    joints = enumerate(robot.transmission.joints)
    columns = {f"{joint}.{what}": values[:, i] for i, joint in joints for what, values in parts}
    return save_log(Log(time, columns), name)


_MARGIN = 0.02  # [m] that links keep, as `CollisionLimit` does


class LinkDistances:
    """Pairs of links that must keep a distance of 20 mm, of the solids in a robot's model file.

    Links that a joint joins, and those that are nearer in the pose about which the robot moves,
    are no pairs: they touch by design.

    Attributes:
        solids: with their pairs.
    """

    def __init__(self, robot: Robot, center: FloatArray) -> None:
        """Find the pairs of a robot that moves about `center` (m,) of the driven joints."""
        self._robot, self.solids = robot, collision_solids(robot)
        self.solids.addAllCollisionPairs()  # of solids that different joints move
        joints = [one.parentJoint for one in self.solids.geometryObjects]
        (position,) = _whole(robot, center[None])
        near, parents = self._touching(position, first=False), robot.model.parents
        pairs = self.solids.collisionPairs.tolist(deep_copy=True)
        for pair, touch in zip(pairs, near, strict=True):
            a, b = joints[pair.first], joints[pair.second]
            if touch or parents[a] == b or parents[b] == a:
                self.solids.removeCollisionPair(pair)

    def keeps(self, positions: FloatArray) -> bool:
        """Whether all pairs stay apart at driven positions (N, m); a free base is held."""
        rows = _whole(self._robot, positions) if len(self.solids.collisionPairs) else ()
        return not any(any(self._touching(row, first=True)) for row in rows)

    def _touching(self, position: FloatArray, first: bool) -> list[bool]:
        """Return which pairs are too near at q (nq,); only the first of them is looked for."""
        # Fresh data for every row: with those of the row before, coal 3.0.3 starts from its old
        # guess and misses touching links (5 of 300 rows of Solo12, distances wrong by 0.3 m).
        model, near = self._robot.model, self.solids.createData()
        for request in near.collisionRequests:
            request.security_margin = _MARGIN
        pin.computeCollisions(model, model.createData(), self.solids, near, position, first)
        return [result.isCollision() for result in near.collisionResults]


def _whole(robot: Robot, driven: FloatArray) -> FloatArray:
    """Return q (N, nq) at driven positions (N, m), all else as in the usual pose."""
    whole = np.tile(_usual(robot), (len(driven), 1))
    whole[:, robot.actuated_position] = driven
    return whole


def _usual(robot: Robot) -> FloatArray:
    return robot.pose() if robot.poses else robot.neutral()


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Limits of the driven joints, each (m,); infinite where there is none.

    Attributes:
        low, high: positions [rad, m].
        speed: of the joints [rad/s, m/s].
        acceleration: of the joints [rad/s^2, m/s^2].
        torque: of the rotors [N m].
        center: strictly between `low` and `high`; motions start and end there [rad, m].
        clearance: links that keep apart; None for none.
    """

    low: FloatArray
    high: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    center: FloatArray
    clearance: LinkDistances | None = None

    @classmethod
    def of(
        cls,
        robot: Robot,
        span: float = np.inf,
        speed: float = np.inf,
        acceleration: float = np.inf,
        center: FloatArray | None = None,
    ) -> MotionLimits:
        """Return the robot's own limits, narrowed by what is given.

        Args:
            robot: the robot; its model holds positions and speeds, its motors torque and speed.
            span: furthest from `center` [rad, m].
            speed: of every joint [rad/s, m/s].
            acceleration: of every joint [rad/s^2, m/s^2].
            center: (m,) about which the robot moves; its usual pose when left out, the middle of
                its range where that pose lies at a limit.

        Raises:
            DesignError: a limit that is not positive, position limits that leave no room.
        """
        given = {"span": span, "speed": speed, "acceleration": acceleration}
        for name, value in given.items():
            if not value > 0.0:
                raise DesignError(f"the limit of {name} must be > 0, got {value:g}.")
        gears, rows = robot.transmission, robot.actuated
        middle = _usual(robot)[robot.actuated_position] if center is None else center
        # A joint's speed turns several motors in a parallel drive: each bounds it alone.
        per_speed = np.abs(gears.gear_ratio[:, None] * gears.motor_from_joint)
        with np.errstate(divide="ignore"):
            own = np.min(gears.speed_limit[:, None] / per_speed, axis=0)
        model = np.asarray(robot.model.velocityLimit)[rows]
        model = np.where(model > 0.0, model, np.inf)
        low = np.asarray(robot.model.lowerPositionLimit)[robot.actuated_position]
        high = np.asarray(robot.model.upperPositionLimit)[robot.actuated_position]
        ranged = high > low
        low, high = np.where(ranged, low, -np.inf), np.where(ranged, high, np.inf)
        inside = (low < middle) & (middle < high)
        with np.errstate(invalid="ignore"):
            middle = np.where(inside, middle, 0.5 * (low + high))
        low, high = np.maximum(low, middle - span), np.minimum(high, middle + span)
        if not np.all((low < middle) & (middle < high)):
            raise DesignError("the position limits leave no room to move.")
        return cls(
            low=low,
            high=high,
            speed=np.minimum(np.minimum(model, own), speed),
            acceleration=np.full(gears.size, acceleration),
            torque=np.array(gears.torque_limit),
            center=middle,
            clearance=LinkDistances(robot, middle),
        )

    def joint_shares(self, motion: Course) -> FloatArray:
        """Return (m,) the largest share of position, speed or acceleration that each joint uses.

        Args:
            motion: positions, velocities, accelerations (N, m).
        """
        q, v, a = motion
        shares = [
            (q - self.center) / (self.high - self.center),
            (self.center - q) / (self.center - self.low),
            np.abs(v) / self.speed,
            np.abs(a) / self.acceleration,
        ]
        return np.asarray(np.max([share.max(axis=0) for share in shares], axis=0))

    def each_within(self, path: FourierPath) -> FourierPath:
        """Return the path with every joint that breaks a limit of its own made smaller, alone.

        So one joint that reaches its limit does not hold back the others.
        """
        used = self.joint_shares(path.at(path.times(SEARCH_RATE)))
        return path.scaled(np.minimum(1.0, 0.97 * ROOM / np.maximum(used, 1e-300)))


def predicted(
    rivals: Rivals, limits: MotionLimits, path: FourierPath, rate: float = SEARCH_RATE
) -> tuple[Predictions, float]:
    """Return what the rivals predict along a path, and the largest share of a limit that it uses.

    Args:
        rivals: of a robot whose base is held.
        limits: that the motion should stay inside.
        path: of the driven joints.
        rate: of its samples [Hz].
    """
    robot, time = rivals.robot, path.times(rate)
    course = path.at(time)
    velocity, acceleration = np.zeros((2, len(time), robot.model.nv))
    velocity[:, robot.actuated], acceleration[:, robot.actuated] = course[1:]
    motion = Motion(_whole(robot, course[0]), velocity, acceleration, time)
    found = rivals.predictions(motion)
    used = max(limits.joint_shares(course).max(), (found.peak() / limits.torque).max())
    return found, float(used)


def fitted(
    rivals: Rivals, limits: MotionLimits, path: FourierPath
) -> tuple[FourierPath, Predictions]:
    """Return the path made as large as the limits allow, and its predictions.

    Torque does not grow in proportion to the size: the scale is found in a few rounds, and a
    path that breaks a limit, or brings links too near one another, is made smaller.
    """
    for _ in range(6):
        found, used = predicted(rivals, limits, path)
        if 0.9 * ROOM <= used <= ROOM:
            break
        path = path.scaled(0.97 * ROOM / used)
    near = limits.clearance
    while used > ROOM or not (near is None or near.keeps(path.at(path.times(SEARCH_RATE))[0])):
        path = path.scaled(0.9)
        found, used = predicted(rivals, limits, path)
    return path, found
