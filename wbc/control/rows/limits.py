"""Limits: what motors and joints cannot do; efforts: what should be small about their torques."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any, ClassVar, final, get_type_hints

import numpy as np

from wbc.arrays import FloatArray, frozen, must
from wbc.compiled import OutRow, Places, Row
from wbc.control.inputs import Checked
from wbc.errors import ControlError
from wbc.robot import Robot, state_gear
from wbc.structures import Structure

_SHARE = 0.8  # of a motor's torque limit that braking counts on; the load changes until it rests
_ENDLESS = 1e8  # [rad, rad/s] stated in place of none
_none = partial(frozen, ())


@final
@dataclass(frozen=True)
class RotorTorqueLimit(Checked):
    """The rotor torque limits of the robot's transmission, kept through the gears.

    Attributes:
        fraction: share of each limit that the controller may use, in (0, 1].
        knee: share of the transmission's speed limit up to which the full torque is there; beyond
            it the torque along the motion falls in a straight line to nothing at the speed limit,
            as that of a motor at its voltage limit does. Braking keeps the full torque. None
            leaves the torque independent of speed.
    """

    fraction: float = field(default=1.0, metadata=must("> 0 and <= 1"))
    knee: float | None = field(default=None, metadata=must(">= 0 and < 1"))

    _told = "rotor torque limit: "

    def bounds(self, robot: Robot, rotor_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest rotor torque (m,) [N m] at these rotor speeds."""
        full = self.fraction * robot.transmission.torque_limit
        if self.knee is None:
            return -full, full
        used = np.abs(rotor_speed) / robot.transmission.speed_limit
        along = np.clip((1.0 - used) / (1.0 - self.knee), 0.0, 1.0) * full
        forward = rotor_speed >= 0.0
        return np.where(forward, -full, -along), np.where(forward, along, full)


def _stated(robot: Robot) -> tuple[str, ...]:
    """Return the driven joints of which the model states a stop or a greatest speed."""
    model, at = robot.model, robot.actuated_position
    low, high = model.lowerPositionLimit[at], model.upperPositionLimit[at]
    least = np.abs([low, high, model.upperVelocityLimit[robot.actuated]]).min(axis=0)
    stated = (low < high) & (least < _ENDLESS)
    return tuple(j for j, yes in zip(robot.transmission.joints, stated, strict=True) if yes)


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

    A joint that is braked by its motor drives it, so the teeth help: of the torque T that holds it
    back only eta_b T arrives at the motor, which also has its own rotor to stop. With the inertia M
    of the joint, the others locked, and the load c on it (gravity, contact forces, what its motion
    asks) in the last tick,

        |T| = (U - N^2 I_r b)/eta_b,   M b = |T| +- c
        b = (U/eta_b +- c)/(M + N^2 I_r/eta_b),

    plus where the load helps. A gear that cannot be driven backwards brakes as hard as one likes.
    Where motors share joints (T = D' tau), a torque on one joint alone is what the weakest of its
    motors holds, and the rotors of all of them have to stop.

    `JointLimit()` stands for `JointLimit.of(robot)`, whatever robot the controller has, and is what
    a controller has by default.

    Attributes:
        joints: names, in the order of the arrays.
        rows: velocity rows (k,) of the joints.
        position_rows: position rows (k,).
        lower, upper: stops (k,) [rad or m].
        speed: greatest speed (k,) [rad/s or m/s].
        acceleration: greatest acceleration (k,), which is also the greatest braking b.
        torque: (k,) [N m] with which motors hold a joint back at most, infinite without
        reflected: (k,) inertia of the rotors then.
    """

    joints: tuple[str, ...] = ()
    rows: Places = field(default_factory=_none)
    position_rows: Places = field(default_factory=_none)
    lower: Row = field(default_factory=_none)
    upper: Row = field(default_factory=_none)
    speed: Row = field(default_factory=_none)
    acceleration: Row = field(default_factory=_none)
    torque: Row = field(default_factory=_none)
    reflected: Row = field(default_factory=_none)

    @classmethod
    def of(
        cls,
        robot: Robot,
        joints: Sequence[str] | None = None,
        *,
        acceleration: float | FloatArray = np.inf,
        margin: float = 0.0,
        braking: float | None = None,
    ) -> JointLimit:
        """Return the limits that the robot's model states.

        Args:
            joints: names of one-degree joints; when left out all driven ones of which the model
                states a stop or a greatest speed.
            acceleration: greatest acceleration and braking [rad/s^2], one number or one per joint;
                left out there is none but what the motors can do.
            margin: distance kept from every stop [rad].
            braking: share of the motors' torque limits that braking may count on, in (0, 1]; left
                out joints brake with `acceleration`, or with 0.8 where that is infinite.

        Raises:
            ControlError: an acceleration that is not positive, or stops that leave no room.
            RobotError: no such joint.
        """
        names = _stated(robot) if joints is None else tuple(joints)
        rows = [robot.velocity_index(joint) for joint in names]
        places = [robot.position_index(joint) for joint in names]
        lower = np.asarray(robot.model.lowerPositionLimit)[places] + margin
        upper = np.asarray(robot.model.upperPositionLimit)[places] - margin
        for joint, low, high in zip(names, lower, upper, strict=True):
            if not low < high:
                raise ControlError(f"joint '{joint}': stops at {low:g} and {high:g} leave no room.")
        greatest = np.broadcast_to(np.asarray(acceleration, dtype=np.float64), (len(rows),))
        if not np.all(greatest > 0.0):
            raise ControlError("the greatest acceleration of a joint must be positive.")
        if braking is not None and not 0.0 < braking <= 1.0:
            raise ControlError(f"joint limit: braking must lie in (0, 1], got {braking:g}.")
        if braking is None and np.isinf(greatest).any():
            braking = _SHARE
        speed = np.abs(np.asarray(robot.model.upperVelocityLimit)[rows])
        return cls(
            joints=names,
            rows=frozen(rows, np.int_),
            position_rows=frozen(places, np.int_),
            lower=frozen(lower),
            upper=frozen(upper),
            speed=frozen(np.where(speed > 0.0, speed, np.inf)),
            acceleration=frozen(greatest),
            **_braking(robot, names, braking),
        )

    def structure(self, nv: int) -> Any:
        """Return JOINTS with a memory of the load that no other controller has."""
        load = np.full(nv if np.isfinite(self.torque).any() else 0, np.nan)
        return JOINTS.of(load=load, **vars(self))


_ARRAYS = get_type_hints(JointLimit, include_extras=True)
# The arrays of a `JointLimit`, and of the last tick the torque on the coordinates less M qdd.
#
# `load` (nv,) is NaN where there was none, (0,) where nobody asks.
JOINTS = Structure("Joints", load=OutRow, **{name: _ARRAYS[name] for name in [*_ARRAYS][1:]})
JointsMemory = Annotated[Any, JOINTS.kind]


def _braking(robot: Robot, joints: tuple[str, ...], braking: float | None) -> dict[str, FloatArray]:
    """Return the fields of a `JointLimit` about motors that brake joints; endless without."""
    if braking is None:
        return dict.fromkeys(("torque", "reflected"), frozen(np.full(len(joints), np.inf)))
    gears = robot.transmission
    for joint in joints:
        if joint not in gears.joints:
            raise ControlError(
                f"joint '{joint}' has no motor to brake it; give its braking as a number "
                f"(acceleration=...). Joints that have one: {', '.join(gears.joints)}."
            )
    own = [gears.joints.index(joint) for joint in joints]
    drives, eta = gears.backward_efficiency > 0.0, gears.backward_efficiency.clip(1e-9)
    held = braking * np.abs(gears.gear_ratio * gears.torque_limit) / eta
    held = np.where(drives & np.isfinite(held), held, np.inf)
    with np.errstate(divide="ignore"):
        torque = (held / np.abs(gears.topology)[own]).min(axis=1)
    B = gears.motor_from_joint[:, own]
    reflected = np.where(drives, gears.reflected_inertia / eta, gears.reflected_inertia)
    return {"torque": frozen(torque), "reflected": frozen((B * B * reflected[:, None]).sum(axis=0))}


@dataclass(frozen=True, eq=False, kw_only=True)
class Effort(Checked):
    """Something about the gears' torques that should be small; subclasses are final and frozen.

    Where the robot has more ways to move or to push than its tasks decide, efforts choose among
    them; weights small against those of the tasks leave the tasks alone.

    It costs 1/2 sum w y^2 over the gears, where y is N tau_phi = e T + what the rotor takes itself,
    with e the slope of the mesh law in the predicted direction, or T.

    Attributes:
        name: how messages call it.
        weight: >= 0.
    """

    name: str
    weight: float = field(metadata=must(">= 0 and < inf"))

    _told = "effort '{0.name}': "
    of_rotors: ClassVar[bool] = False
    least_torque: ClassVar[float] = 0.0

    def weights(self, robot: Robot) -> FloatArray:
        """Return w (m,); what a mesh loses is multiplied with |e - 1| |dpsi| / |T_0| as well."""
        return np.full(robot.transmission.size, self.weight)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class JouleHeatEffort(Effort):
    """weight sum R (tau_phi / k_t)^2 [W], the heat of all windings."""

    name: str = "joule_heat"

    of_rotors: ClassVar[bool] = True

    def weights(self, robot: Robot) -> FloatArray:
        """Return the weights of R (N tau_phi / (N k_t))^2.

        Raises:
            ControlError: a motor lacks its resistance or torque constant.
        """
        gears = robot.transmission
        for number in ("torque_constant", "resistance"):
            unknown = np.flatnonzero(np.isnan(getattr(gears, number)))
            if unknown.size:
                joint = gears.joints[int(unknown[0])]
                way = f"Use RotorTorqueEffort, or {state_gear(joint, number)}"
                raise self.wrong(f"the motor of '{joint}' has no {number}. {way}")
        scale = gears.resistance / (gears.torque_constant * gears.gear_ratio) ** 2
        return np.asarray(2.0 * self.weight * scale)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class MeshLossEffort(Effort):
    """weight sum (t - T) dpsi [W], what the meshes turn into heat.

    The loss is |e - 1| |dpsi| |T|; its absolute value is majorised by a parabola through the last
    tick's torque, |T| <= T^2/(2 |T_0|) + |T_0|/2, which ticks that follow one another closely
    turn into the absolute value itself. Under half a newton metre |T_0| is not taken, so that the
    parabola stays finite.
    """

    name: str = "mesh_loss"
    least_torque: ClassVar[float] = 0.5


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class OutputTorqueEffort(Effort):
    """weight/2 sum T^2 [(N m)^2], the torque that leaves each gear (joint torque where D = 1)."""

    name: str = "output_torque"


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class RotorTorqueEffort(Effort):
    """weight/2 sum tau_phi^2 [(N m)^2], losses and rotor inertia included."""

    name: str = "rotor_torque"
    of_rotors: ClassVar[bool] = True

    def weights(self, robot: Robot) -> FloatArray:
        """Return the weights of N tau_phi."""
        return np.asarray(self.weight / robot.transmission.gear_ratio**2)
