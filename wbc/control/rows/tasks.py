"""What a task is: a value, its error, Jacobian and drift; those of joints, frames and the robot."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from itertools import pairwise
from math import atan2, sqrt
from typing import Any, ClassVar, TypeAlias, final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray, must, reals
from wbc.compiled import Dense, compiled
from wbc.control.inputs import Checked, Target
from wbc.control.kinematics import KIND, Kinematics, StateRows, frame_number, place_missing
from wbc.errors import ControlError
from wbc.mechanics.linear import add_cross, dot
from wbc.robot import Robot

_FLOAT = np.dtype(np.float64)
_TURNED = 1e-4  # single precision leaves 1e-7, four printed digits 1e-4


Gains: TypeAlias = tuple[float, float, float, float]
"""What error, rate J v, and velocity and acceleration of the reference count for."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Task(Checked, ABC):
    """A motion that the controller pursues in the least-squares sense.

    With e = target - value, the task wants

        J qdd + dJ/dt v = acc_ref + damping (vel_ref - J v) + stiffness e

    and costs weight/2 times the squared violation. Subclasses are final, frozen and know nothing
    of the QP.

    What is fed back is limited: of every row the spring asks for `acceleration_limit` at most, and
    so does spring and damper together. A far target then pulls as one does that is
    acceleration_limit/stiffness away: the task moves with up to acceleration_limit/damping towards
    it, straight on in every row, and does not overshoot. The energy of such a spring and damper
    never grows. `Reference.acceleration` is not limited.

    Attributes:
        name: how references, statuses and messages call it.
        weight: w >= 0, one number or one per row.
        stiffness: [1/s^2].
        damping: [1/s]; left out it is critical, 2 sqrt(stiffness).
        acceleration_limit: > 0 of every row [m/s^2, rad/s^2], infinite for no limit. Joint limits
            bound the tasks of joints and frames already; that of the centre of mass has one.
        level: 0 for an ordinary task; a task of a level above it is strictly less important: it
            moves nothing that the tasks of lower levels decide.
    """

    name: str
    weight: float | FloatArray = field(default=1.0, metadata=must(">= 0 and < inf"))
    stiffness: float = field(default=100.0, metadata=must(">= 0 and < inf"))
    damping: float | None = field(default=None, metadata=must(">= 0 and < inf"))
    acceleration_limit: float = field(default=np.inf, metadata=must("> 0"))
    level: int = 0

    _told = "task '{0.name}': "

    def __post_init__(self) -> None:
        """Check gains and weights."""
        super().__post_init__()
        if isinstance(self.level, bool) or not isinstance(self.level, int) or self.level < 0:
            raise self.wrong(f"level must be a whole number >= 0, got {self.level}.")

    @abstractmethod
    def check(self, robot: Robot) -> int:
        """Return the number of rows on `robot`; raise ControlError where it does not fit."""

    @abstractmethod
    def value(self, kinematics: Kinematics) -> Target:
        """Return the present value, of the kind that a reference's `position` has."""

    def admitted(self, target: Target, size: int) -> Target:
        """Return the `position` of a reference, checked and copied; ControlError if it is none.

        By default it is an array (size,), as many numbers as the task has rows.
        """
        return vector_target(target, size)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value (k,) in the task's rows; its rate is vel_ref - J v at e = 0."""
        return np.asarray(target - self.value(kinematics))

    @abstractmethod
    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return J (k, nv)."""

    @abstractmethod
    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return dJ/dt v (k,)."""

    def gains(self, gravity: float) -> Gains:
        """Return what the parts of the wanted acceleration count for, at a gravity [m/s^2]."""
        damping = 2.0 * sqrt(self.stiffness) if self.damping is None else self.damping
        return self.stiffness, -damping, damping, 1.0


@dataclass(frozen=True, eq=False, kw_only=True)
class StateTask(Task):
    """A task whose rows follow from the state, so that a tick evaluates those of all at once.

    Its error is what is missing in these rows between the present placement and the one that `pack`
    writes.

    Attributes:
        kind: what the rows are of.
        own_rows: which of the six it has.
    """

    kind: ClassVar[int]
    own_rows: ClassVar[slice] = slice(0, 6)

    def __post_init__(self) -> None:
        """Check the rows."""
        super().__post_init__()
        self.rows()

    def rows(self) -> slice:
        """Return which of the six rows, linear over angular, the task has."""
        return self.own_rows

    @property
    def state_rows(self) -> StateRows:
        """The rows that the tick evaluates."""
        return StateRows(self.kind, "", self.rows())

    def check(self, robot: Robot) -> int:
        """Return the number of rows; raise ControlError where a frame is missing."""
        for frame in filter(None, (self.state_rows.frame, self.state_rows.other)):
            frame_number(robot.model, frame, f"task '{self.name}': ")
        return len(range(*self.rows().indices(6)))

    def value(self, kinematics: Kinematics) -> Target:
        """Return the part of the placement that the rows are about, see `slot`."""
        return np.array(self.slot(kinematics.evaluated(self.state_rows).places[0]))

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return what is missing to a target in the task's rows (k,), as in a tick."""
        rows, place = kinematics.evaluated(self.state_rows), np.zeros(12)
        self.pack(target, place)
        missing = np.zeros(len(rows.drift))
        place_missing(rows, 0, place, rows.jacobian @ kinematics.velocity, missing)
        return missing

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return J (k, nv)."""
        return np.asarray(kinematics.evaluated(self.state_rows).jacobian)

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return dJ/dt v (k,)."""
        return np.asarray(kinematics.evaluated(self.state_rows).drift)

    def slot(self, place: FloatArray) -> FloatArray:
        """Return the part of a placement (12,) in which a target stands that is an array.

        A rotation row by row stands before the translation or the number of a distance or pitch.
        """
        return (place if self.kind == KIND.momentum else place[9:])[self.rows()]

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write a target, as `admitted` returns it, to where the tick reads it (12,)."""
        self.slot(place)[:] = target


@dataclass(frozen=True, eq=False, kw_only=True)
class AxesTask(StateTask):
    """A task along some axes of the world.

    Attributes:
        axes: which of "xyz" belong to the task, for example "xz" or "z".
    """

    axes: str = "xyz"
    turns: ClassVar[bool] = False

    def rows(self) -> slice:
        """Return the linear rows of the axes, or the angular ones; ControlError for other axes."""
        axes, first = ["xyz".find(letter) for letter in self.axes], 3 if self.turns else 0
        if not axes or min(axes) < 0 or any(a >= b for a, b in pairwise(axes)):
            raise self.wrong(f"axes must be some of x, y, z in this order, got '{self.axes}'.")
        step = axes[1] - axes[0] if len(axes) > 1 else 1
        return slice(first + axes[0], first + axes[-1] + 1, step)


def numbers(given: Any, shape: tuple[int, ...], told: str) -> FloatArray:
    """Return what was given as a new array of a shape; any one number is an array (1,).

    `told` is what the message of a ControlError calls it.
    """
    try:
        values = reals(given)
    except (TypeError, ValueError) as cause:
        raise ControlError(f"{told} holds no array of numbers: {cause}") from cause
    if shape == (1,) and values.size == 1:
        return values.reshape(1)
    if values.shape != shape:
        raise ControlError(f"{told} has shape {values.shape}, expected {shape}")
    return values


def vector_target(target: Any, size: int, told: str = "position") -> FloatArray:
    """Return a target as a new array (size,), see `numbers`."""
    if type(target) is np.ndarray and target.dtype is _FLOAT and target.shape == (size,):
        return target.copy()
    return numbers(target, (size,), told)


def rotation_target(target: Any) -> FloatArray:
    """Return a target as a new rotation matrix (3, 3), see `numbers`.

    Raises:
        ControlError: a matrix that is no rotation. One that is not finite passes, so that it is
            named as such.
    """
    told = "position, a rotation matrix (of roll, pitch and yaw pin.rpy.rpyToMatrix makes one),"
    matrix = numbers(target, (3, 3), told)
    if rotation_error(np.ascontiguousarray(matrix)) > _TURNED:
        raise ControlError("position is no rotation matrix: R'R = 1 and det R = 1 do not hold")
    return matrix


@compiled
def rotation_error(matrix: Dense) -> float:
    """Return the largest entry of |R R' - 1|, at least 2 for a reflection; NaN where R has one."""
    worst, across = 0.0, np.zeros(3)
    for i in range(3):
        for j in range(3):
            worst = max(worst, abs(dot(matrix[i], matrix[j]) - (1.0 if i == j else 0.0)))
    add_cross(1.0, matrix[0], matrix[1], across)
    return max(worst, 2.0) if dot(across, matrix[2]) < 0.0 else worst


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class PostureTask(Task):
    """Positions of joints with one degree of freedom, driven or not [rad or m].

    Attributes:
        joints: names of the joints, in the order of the rows.
    """

    name: str = "posture"
    joints: tuple[str, ...]

    @classmethod
    def of(
        cls, robot: Robot, joints: tuple[str, ...] | None = None, **settings: Any
    ) -> PostureTask:
        """Return the posture task of `joints` (all driven ones when left out) on `robot`.

        Args:
            joints: names.
            settings: as for `Task`.

        Raises:
            ControlError: a joint with several degrees of freedom.
            RobotError: no such joint.
        """
        names = robot.transmission.joints if joints is None else tuple(joints)
        task = cls(joints=names, **settings)
        task.check(robot)
        return task

    def check(self, robot: Robot) -> int:
        """Return the number of joints."""
        for joint in self.joints:
            robot.velocity_index(joint)
            if joint not in robot.single_joints:
                raise self.wrong(
                    f"joint '{joint}' has several degrees of freedom; use FramePoseTask on the "
                    "link it carries."
                )
        return len(self.joints)

    def places(self, model: pin.Model) -> tuple[IntArray, IntArray]:
        """Return where (k,) q and v hold the joints."""
        own = [model.joints[model.getJointId(joint)] for joint in self.joints]
        rows = np.array([(one.idx_q, one.idx_v) for one in own], dtype=np.int_).reshape(-1, 2)
        return rows[:, 0], rows[:, 1]

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the joints' positions, (k,)."""
        return kinematics.position[self.places(kinematics.model)[0]]

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the selection of the joints' rows, (k, nv)."""
        return np.eye(kinematics.model.nv)[self.places(kinematics.model)[1]]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return zeros, (k,)."""
        return np.zeros(len(self.joints))


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameTask(StateTask):
    """A task on the placement of a frame; subclasses are final and choose rows of it.

    Rates and accelerations are those of the frame's origin and its angular ones, in world axes.

    Attributes:
        frame: name of a frame of the model.
    """

    frame: str
    kind: ClassVar[int] = KIND.frame

    @property
    def state_rows(self) -> StateRows:
        """The rows of the frame."""
        return StateRows(self.kind, self.frame, self.rows())


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FramePositionTask(FrameTask, AxesTask):
    """Position of a frame's origin along some axes of the world [m]."""


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FrameOrientationTask(FrameTask, AxesTask):
    """Orientation of a frame; the value is its rotation matrix (3, 3), world from frame.

    The error is the rotation vector R log3(R' R_target) in world axes [rad], of which the task
    takes the components along its axes, "y" for the pitch of a planar robot.
    """

    turns: ClassVar[bool] = True

    def slot(self, place: FloatArray) -> FloatArray:
        """Return the rotation (3, 3) of a placement (12,)."""
        return place[:9].reshape(3, 3)

    def admitted(self, target: Target, size: int) -> FloatArray:
        """Return a rotation matrix (3, 3), checked and copied."""
        return rotation_target(target)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FramePoseTask(FrameTask):
    """Pose of a frame; the value is a `pin.SE3`, world from frame.

    Rows are the position's error [m] over the rotation vector R log3(R' R_target) [rad], both in
    world axes.
    """

    def value(self, kinematics: Kinematics) -> pin.SE3:
        """Return the placement, world from frame."""
        place = kinematics.evaluated(self.state_rows).places[0]
        return pin.SE3(place[:9].reshape(3, 3), place[9:])

    def admitted(self, target: Target, size: int) -> pin.SE3:
        """Return a `pin.SE3`, checked and copied."""
        if not isinstance(target, pin.SE3):
            raise ControlError(f"position must be a pin.SE3, got {type(target).__name__}")
        rotation_target(target.rotation)
        return target.copy()

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target as a placement (12,)."""
        place[:9], place[9:] = target.rotation.reshape(-1), target.translation


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FrameDistanceTask(StateTask):
    """Distance between the origins of two frames [m].

    With r from one to the other and n = r/|r|, the one row is n'(J_other - J_one) and

        d2|r|/dt2 = n'(a_other - a_one) + |r' - n (n'r')|^2/|r|.

    Attributes:
        frame, other: names of frames of the model.
    """

    name: str = "distance"
    frame: str
    other: str
    kind: ClassVar[int] = KIND.distance
    own_rows: ClassVar[slice] = slice(0, 1)

    @property
    def state_rows(self) -> StateRows:
        """The rate of the distance."""
        return StateRows(self.kind, self.frame, self.rows(), other=self.other)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CenterOfMassTask(AxesTask):
    """Position of the centre of mass along some world axes [m].

    Its acceleration is limited to that of gravity unless told otherwise: the ground only pushes, so
    that nothing falls faster, and with a friction of 0.7 it gives less sideways.

    While it is to rest somewhere (its reference has no velocity and no acceleration) and three or
    more corners of contacts face up, it goes no farther than they can carry it: a target beside
    them is one at their edge. Who steps gives a velocity, and goes where it leads. Without a limit
    of acceleration there is none of this kind.
    """

    name: str = "center_of_mass"
    acceleration_limit: float = 9.81
    kind: ClassVar[int] = KIND.center_of_mass


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CapturePointTask(StateTask):
    """The capture point, or divergent component of motion, along x and y of the world [m].

    With c the centre of mass and b = sqrt(g/height), xi = c + c'/b runs away from the centre of
    pressure, c follows it by itself (Pratt 2006, Englsberger 2015). The task wants

        xi' = xi'_ref + stiffness (xi_ref - xi),    c'' = b (xi' - c')

    with a stiffness in [1/s]; `Reference.position` is xi_ref and `Reference.velocity` xi'_ref. Kept
    inside the soles, xi can be stopped without a step.

    Attributes:
        height: [m] of the centre of mass above the ground that b is computed with.
    """

    name: str = "capture_point"
    stiffness: float = 5.0
    acceleration_limit: float = 9.81
    height: float = field(metadata=must("> 0 m and < inf"))
    kind: ClassVar[int] = KIND.center_of_mass
    own_rows: ClassVar[slice] = slice(0, 2)

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return xi (2,) [m]."""
        rate = self.jacobian(kinematics) @ kinematics.velocity
        pole = sqrt(kinematics.gravity / self.height)
        return np.asarray(kinematics.tree.com[:2] + rate / pole)

    def gains(self, gravity: float) -> Gains:
        """Return the gains of c'' = b (xi' - c') on the error xi_ref - c and the rate c'."""
        pole = sqrt(gravity / self.height)
        return pole * self.stiffness, -(pole + self.stiffness), pole, 1.0


@dataclass(frozen=True, eq=False, kw_only=True)
class MomentumTask(StateTask):
    """Rows of the momentum about the centre of mass; subclasses are final and choose them.

    The value is itself a rate, so the task wants

        dh/dt = A_g qdd + dA_g/dt v = dh_ref/dt + stiffness (h_ref - h)

    with a stiffness in [1/s]; `Reference.position` is h_ref and `Reference.velocity` dh_ref/dt.
    """

    stiffness: float = 10.0
    kind: ClassVar[int] = KIND.momentum

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return h (k,) [kg m/s, N m s]."""
        return np.asarray(self.jacobian(kinematics) @ kinematics.velocity)

    def gains(self, gravity: float) -> Gains:
        """Return the gains of dh/dt = dh_ref/dt + stiffness (h_ref - h)."""
        return self.stiffness, 0.0, 1.0, 0.0


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class LinearMomentumTask(MomentumTask, AxesTask):
    """Linear momentum of the whole robot along some world axes [kg m/s]."""

    name: str = "linear_momentum"


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class AngularMomentumTask(MomentumTask, AxesTask):
    """Angular momentum about the centre of mass along some world axes [N m s]."""

    name: str = "angular_momentum"
    turns: ClassVar[bool] = True


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CentroidalMomentumTask(MomentumTask):
    """The whole momentum about the centre of mass, linear over angular [kg m/s, N m s]."""

    name: str = "centroidal_momentum"


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class PointFootBalanceTask(StateTask):
    """Horizontal acceleration of the centre of mass that keeps a robot up on a point foot.

    On a point no torque holds the robot: with x the horizontal distance of the centre of mass
    from the point, z its height, k the angular momentum about the centre of mass (+y) and theta
    the pitch of a frame,

        dk/dt = m (g x - z xdd),    dtheta/dt = a xd + c k

    (a, c from the Jacobians of contact, centre of mass and momentum). The task's one row is xdd;
    it wants the state feedback that puts the four poles of (x, xd, k, theta) at -bandwidth, so
    that the robot leans and swings like an acrobat instead of fighting for x and pitch at once.
    Height belongs to another task. The value is theta [rad]; a reference gives the pitch to keep.

    Attributes:
        contact: frame of the point foot.
        frame: frame whose pitch is kept.
        bandwidth: [1/s] of the poles; None takes sqrt(g/z), the falling rate of the pendulum.
    """

    name: str = "balance"
    contact: str
    frame: str
    bandwidth: float | None = field(default=None, metadata=must("> 0 1/s"))
    kind: ClassVar[int] = KIND.balance
    own_rows: ClassVar[slice] = slice(0, 1)

    @property
    def state_rows(self) -> StateRows:
        """The row of the centre of mass, and what its feedback reads."""
        pole = (self.bandwidth or 0.0, 0.0, 0.0)
        return StateRows(self.kind, self.contact, self.rows(), pole, self.frame)

    def value(self, kinematics: Kinematics) -> float:
        """Return the pitch theta [rad], the rotation of the frame about +y."""
        rotation = kinematics.placement(kinematics.frame_id(self.frame)).rotation
        return atan2(rotation.item(0, 2), rotation.item(2, 2))

    error = Task.error

    def gains(self, gravity: float) -> Gains:
        """Return one for the feedback, which the tick writes in place of the error."""
        return 1.0, 0.0, 0.0, 1.0
