"""Limits: what motors and joints cannot do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from wbc.arrays import FloatArray, IntArray, checked, frozen
from wbc.control.rows.joint_rows import JOINTS, place_bounds
from wbc.errors import ControlError
from wbc.robot import Robot
from wbc.transmission import Transmission


@final
@dataclass(frozen=True)
class RotorTorqueLimit:
    """The rotor torque limits of the robot's transmission, kept through the gears.

    Attributes:
        fraction: share of each limit that the controller may use, in (0, 1].
        knee: share of the transmission's speed limit up to which the full torque is there; beyond
            it the torque along the motion falls in a straight line to nothing at the speed limit,
            as that of a motor at its voltage limit does. Braking keeps the full torque. None
            leaves the torque independent of speed.
    """

    fraction: float = 1.0
    knee: float | None = None

    def __post_init__(self) -> None:
        """Check the fraction."""
        if not 0.0 < self.fraction <= 1.0:
            raise ControlError(
                f"rotor torque limit: fraction must lie in (0, 1], got {self.fraction:g}."
            )
        if self.knee is not None and not 0.0 <= self.knee < 1.0:
            raise ControlError(f"rotor torque limit: knee must lie in [0, 1), got {self.knee:g}.")

    @property
    def is_constant(self) -> bool:
        """Whether the bounds are the same at every speed."""
        return self.knee is None

    def bounds(self, robot: Robot, rotor_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest rotor torque (m,) [N m] at these rotor speeds."""
        full = self.fraction * robot.transmission.torque_limit
        if self.knee is None:
            return -full, full
        top = robot.transmission.speed_limit
        with np.errstate(invalid="ignore"):
            used = np.abs(rotor_speed) / top
        left = np.clip((1.0 - used) / (1.0 - self.knee), 0.0, 1.0)
        along = np.where(np.isfinite(top), left, 1.0) * full
        forward = rotor_speed >= 0.0
        return np.where(forward, -full, -along), np.where(forward, along, full)


@final
@dataclass(frozen=True)
class MotorBraking:
    """The deceleration that a motor's own torque gives its joint.

    A joint that is braked drives its motor, so the teeth help: of the torque T that holds it back
    only eta_b T arrives at the motor, which also has its own rotor to stop. With the inertia M of
    the joint, the others locked, and the load c on it (gravity, contact forces, what its motion
    asks),

        |T| = (U - N^2 I_r b)/eta_b,   M b = |T| +- c
        b = (U/eta_b +- c)/(M + N^2 I_r/eta_b),

    plus where the load helps. A gear that cannot be driven backwards brakes as hard as one likes.
    The load is that of the last tick; `share` leaves room for what changes until the joint rests.

    Attributes:
        share: of the motor's torque limit that braking may count on, in (0, 1].
        least: deceleration [rad/s^2] to count on where the load leaves none.
    """

    share: float = 0.8
    least: float = 1.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0.0 < self.share <= 1.0:
            raise ControlError(f"motor braking: share must lie in (0, 1], got {self.share:g}.")
        if not self.least > 0.0:
            raise ControlError(f"motor braking: least must be > 0 rad/s^2, got {self.least:g}.")

    def check(self, robot: Robot, joints: tuple[str, ...]) -> None:
        """Raise ControlError for a joint that is not driven by a motor of its own."""
        own = serial_gears(robot.transmission)
        for joint in joints:
            if joint not in own:
                raise ControlError(
                    f"joint '{joint}' has no motor of its own to brake it; give its braking as a "
                    f"number (acceleration=...). Joints that have one: {', '.join(own)}."
                )


def serial_gears(gears: Transmission) -> dict[str, int]:
    """Return the joints that have a motor of their own, with its number."""
    topology = np.asarray(gears.topology)
    alone = [
        i
        for i in range(gears.size)
        if topology[i, i] == 1.0
        and np.count_nonzero(topology[i]) == 1
        and np.count_nonzero(topology[:, i]) == 1
    ]
    return {gears.joints[i]: i for i in alone}


def _no_rows() -> IntArray:
    return frozen([], np.int_)


def _no_numbers() -> FloatArray:
    return frozen([])


def _no_braking() -> dict[str, Any]:
    """Return the fields of JOINTS for joints that brake with their greatest acceleration."""
    empty = {name: np.zeros(0) for name in ("torque", "reflected", "least", "load")}
    return {"gears": _no_rows(), **empty}


@final
@dataclass(frozen=True, eq=False)
class JointLimit:
    """Position, velocity and acceleration limits of joints, as bounds on their accelerations.

    With braking at most b, a joint at distance d from its stop may not be faster than
    sqrt(2 b d); the bound on the acceleration over one step h is the least of

        (v_max - v)/h,   a such that (v + h a)^2 = 2 b (d - h v - h^2 a/2),   a_max,

    the second judging speed and distance at the end of the step, so that a joint which keeps it
    can always stop in time (a viable state stays viable, Del Prete 2018). A joint already beyond
    its stop or too fast for it brakes with b at most. Where it cannot be kept it is passed, see
    `Command.passed`.

    `JointLimit()` stands for `JointLimit.of(robot)`, whatever robot the controller has.

    Attributes:
        joints: names, in the order of the arrays.
        rows: velocity rows (k,) of the joints.
        position_rows: position rows (k,).
        lower, upper: stops (k,) [rad or m].
        speed: greatest speed (k,) [rad/s or m/s].
        acceleration: greatest acceleration (k,), which is also the greatest braking b.
        brakes: fields of JOINTS that say what the motors can do about it.
    """

    joints: tuple[str, ...] = ()
    rows: IntArray = field(default_factory=_no_rows)
    position_rows: IntArray = field(default_factory=_no_rows)
    lower: FloatArray = field(default_factory=_no_numbers)
    upper: FloatArray = field(default_factory=_no_numbers)
    speed: FloatArray = field(default_factory=_no_numbers)
    acceleration: FloatArray = field(default_factory=_no_numbers)
    brakes: Mapping[str, Any] = field(default_factory=_no_braking, repr=False)

    @classmethod
    def of(
        cls,
        robot: Robot,
        joints: Sequence[str] | None = None,
        *,
        acceleration: float | FloatArray = 100.0,
        margin: float = 0.0,
        braking: MotorBraking | None = None,
    ) -> JointLimit:
        """Return the limits that the robot's model states.

        Args:
            robot: the robot.
            joints: names of one-degree joints, all driven ones when left out.
            acceleration: greatest acceleration and braking [rad/s^2], one number or one per joint.
            margin: distance kept from every stop [rad].
            braking: how hard the motors can brake; left out they can with `acceleration`.

        Raises:
            ControlError: an acceleration that is not positive, or stops that leave no room.
            RobotError: no such joint.
        """
        names = robot.transmission.joints if joints is None else tuple(joints)
        rows = [robot.velocity_index(joint) for joint in names]
        places = [robot.position_index(joint) for joint in names]
        lower = np.asarray(robot.model.lowerPositionLimit)[places] + margin
        upper = np.asarray(robot.model.upperPositionLimit)[places] - margin
        for joint, low, high in zip(names, lower, upper, strict=True):
            if not low < high:
                raise ControlError(f"joint '{joint}': stops at {low:g} and {high:g} leave no room.")
        greatest = checked(
            np.broadcast_to(acceleration, (len(rows),)), (len(rows),), "acceleration", ControlError
        )
        if np.any(greatest <= 0.0):
            raise ControlError("the greatest acceleration of a joint must be positive.")
        speed = np.abs(np.asarray(robot.model.upperVelocityLimit)[rows])
        return cls(
            joints=names,
            rows=frozen(rows, np.int_),
            position_rows=frozen(places, np.int_),
            lower=frozen(lower),
            upper=frozen(upper),
            speed=frozen(np.where(speed > 0.0, speed, np.inf)),
            acceleration=greatest,
            brakes=_no_braking() if braking is None else _braking(robot, names, braking),
        )

    def structure(self) -> Any:
        """Return JOINTS with a memory of the load that no other controller has."""
        return JOINTS.of(
            rows=self.rows,
            positions=self.position_rows,
            lower=self.lower,
            upper=self.upper,
            speed=self.speed,
            acceleration=self.acceleration,
            **{name: array.copy() for name, array in self.brakes.items()},
        )

    def bounds(
        self, position: FloatArray, velocity: FloatArray, step: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest acceleration (k,) of joints that brake with `acceleration`.

        Args:
            position: q (nq,).
            velocity: v (nv,).
            step: time until the next decision [s].
        """
        lowest, highest, most = (
            np.empty(len(self.rows)),
            np.empty(len(self.rows)),
            self.acceleration,
        )
        place_bounds(self.structure(), position, velocity, step, most, most, (lowest, highest))
        return lowest, highest


def _braking(robot: Robot, joints: tuple[str, ...], braking: MotorBraking) -> dict[str, Any]:
    """Return the fields of JOINTS for joints that their motors brake."""
    braking.check(robot, joints)
    own, gears = serial_gears(robot.transmission), robot.transmission
    numbers = np.array([own[joint] for joint in joints], dtype=np.int_)
    backward = gears.backward_efficiency[numbers]
    eta = np.where(backward > 0.0, backward, 1.0)
    torque = braking.share * np.abs(gears.gear_ratio * gears.torque_limit)[numbers] / eta
    return {
        "gears": numbers,
        "torque": np.where(backward > 0.0, torque, np.inf),
        "reflected": gears.reflected_inertia[numbers] / eta,
        "least": np.array([braking.least]),
        "load": np.full(gears.size, np.nan),
    }
