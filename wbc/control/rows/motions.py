"""Tasks of joints, of frames, and of the whole robot."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt
from typing import Any, ClassVar, final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray, frozen, require_ranges
from wbc.control.inputs import Target
from wbc.control.kinematics import Kinematics, StateRows
from wbc.control.rows.task import AxesTask, Gains, StateTask, Task, rotation_target
from wbc.control.tree import RowKind
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class PostureTask(Task):
    """Positions of joints with one degree of freedom, driven or not [rad or m].

    Build it with `PostureTask.of(robot, ...)`, which resolves the names.

    Attributes:
        joints: names of the joints, in the order of the rows.
        positions, velocities: where (k,) q and v hold them.
    """

    name: str = "posture"
    joints: tuple[str, ...]
    positions: IntArray = field(repr=False)
    velocities: IntArray = field(repr=False)
    _jacobian: FloatArray = field(repr=False)

    @classmethod
    def of(
        cls,
        robot: Robot,
        joints: tuple[str, ...] | None = None,
        *,
        name: str = "posture",
        **settings: Any,
    ) -> PostureTask:
        """Return the posture task of `joints` (all driven ones when left out) on `robot`.

        Args:
            robot: the robot.
            joints: names.
            name, settings: as for `Task`.

        Raises:
            ControlError: a joint with several degrees of freedom (the base is a frame's pose).
            RobotError: no such joint.
        """
        names = robot.transmission.joints if joints is None else tuple(joints)
        rows = [robot.velocity_index(joint) for joint in names]
        for joint in names:
            if joint not in robot.single_joints:
                raise ControlError(
                    f"task '{name}': joint '{joint}' has several degrees of freedom; "
                    "use FramePoseTask on the link it carries."
                )
        jacobian = np.zeros((len(rows), robot.model.nv))
        jacobian[np.arange(len(rows)), rows] = 1.0
        return cls(
            name=name,
            joints=names,
            positions=frozen([robot.position_index(j) for j in names], np.int_),
            velocities=frozen(rows, np.int_),
            _jacobian=frozen(jacobian),
            **settings,
        )

    def check(self, robot: Robot) -> int:
        """Return the number of joints."""
        if self._jacobian.shape[1] != robot.model.nv:
            raise ControlError(f"task '{self.name}' was made for another robot.")
        return len(self.joints)

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the joints' positions, (k,)."""
        return kinematics.position[self.positions]

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the selection of the joints' rows, (k, nv)."""
        return self._jacobian

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
    kind: ClassVar[RowKind] = RowKind.FRAME

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

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the rotation matrix, world from frame, (3, 3)."""
        return np.array(self.evaluated(kinematics).places[0, :9]).reshape(3, 3)

    def admitted(self, target: Target, size: int) -> FloatArray:
        """Return a rotation matrix (3, 3), checked and copied."""
        return rotation_target(target)

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target (3, 3) as the rotation of a placement (12,)."""
        place[:9] = target.reshape(-1)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FramePoseTask(FrameTask):
    """Pose of a frame; the value is a `pin.SE3`, world from frame.

    Rows are the position's error [m] over the rotation vector R log3(R' R_target) [rad], both in
    world axes.
    """

    def value(self, kinematics: Kinematics) -> pin.SE3:
        """Return the placement, world from frame."""
        place = self.evaluated(kinematics).places[0]
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
    kind: ClassVar[RowKind] = RowKind.DISTANCE
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
    kind: ClassVar[RowKind] = RowKind.CENTER_OF_MASS


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
    height: float
    kind: ClassVar[RowKind] = RowKind.CENTER_OF_MASS
    own_rows: ClassVar[slice] = slice(0, 2)

    def __post_init__(self) -> None:
        """Check the height."""
        super().__post_init__()
        require_ranges(self, f"task '{self.name}': ", ControlError, height="> 0 m and < inf")

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return xi (2,) [m]."""
        rate = self.jacobian(kinematics) @ kinematics.velocity
        pole = sqrt(kinematics.gravity / self.height)
        return np.asarray(kinematics.tree.com[:2] + rate / pole)

    def gains(self, gravity: float) -> Gains:
        """Return the gains of c'' = b (xi' - c') on the error xi_ref - c and the rate c'."""
        pole = sqrt(gravity / self.height)
        return Gains(pole * self.stiffness, -(pole + self.stiffness), pole, 1.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class MomentumTask(StateTask):
    """Rows of the momentum about the centre of mass; subclasses are final and choose them.

    The value is itself a rate, so the task wants

        dh/dt = A_g qdd + dA_g/dt v = dh_ref/dt + stiffness (h_ref - h)

    with a stiffness in [1/s]; `Reference.position` is h_ref and `Reference.velocity` dh_ref/dt.
    """

    stiffness: float = 10.0
    kind: ClassVar[RowKind] = RowKind.MOMENTUM

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return h (k,) [kg m/s, N m s]."""
        return np.asarray(self.jacobian(kinematics) @ kinematics.velocity)

    def gains(self, gravity: float) -> Gains:
        """Return the gains of dh/dt = dh_ref/dt + stiffness (h_ref - h)."""
        return Gains(self.stiffness, 0.0, 1.0, 0.0)


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
