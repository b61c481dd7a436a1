"""Tasks on frames: where they are, how they are turned, and how far apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics, StateRows
from wbc.control.reference import Target
from wbc.control.rows.task import (
    AxesTask,
    StateTask,
    axis_rows,
    pose_target,
    require_frame,
    rotation_target,
)
from wbc.control.tree import NO_DISTANCE, RowKind
from wbc.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameTask(StateTask):
    """A task on the placement of a frame; subclasses are final and choose rows of it.

    Seen from the world, rates and accelerations are those of the frame's origin and its angular
    ones, in world axes. Seen from another frame r, with d = p - p_r and omega of r,

        rates    R_r' [d' - omega x d;  omega_f - omega],
        drifts   R_r' [d'' - alpha x d - 2 omega x d' + omega x (omega x d);
                       alpha_f - alpha - omega x (omega_f - omega)].

    Attributes:
        frame: name of a frame of the model.
        relative_to: name of the frame it is seen from, in whose axes all rows are then; the world
            when left out.
    """

    frame: str
    relative_to: str | None = None
    kind: ClassVar[RowKind] = RowKind.FRAME

    def check(self, robot: Robot) -> int:
        """Return the number of rows; raise ControlError where a frame is missing."""
        require_frame(robot, self.frame, self.name)
        if self.relative_to is not None:
            require_frame(robot, self.relative_to, self.name)
        return super().check(robot)

    def placement(self, kinematics: Kinematics) -> pin.SE3:
        """Return the frame's placement in the world or in the frame it is seen from."""
        own = kinematics.placement(kinematics.frame_id(self.frame))
        if self.relative_to is None:
            return own
        return kinematics.placement(kinematics.frame_id(self.relative_to)).actInv(own)

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of the frame's Jacobian, (k, nv)."""
        if self.relative_to is None:
            return super().jacobian(kinematics)
        own, root = kinematics.frame_id(self.frame), kinematics.frame_id(self.relative_to)
        turn, between = self._between(kinematics)
        base = kinematics.frame_jacobian(root)
        relative = kinematics.frame_jacobian(own) - base
        relative[:3] += pin.skew(between) @ base[3:]
        relative[:3], relative[3:] = turn.T @ relative[:3], turn.T @ relative[3:]
        return relative[self.rows()]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of dJ/dt v, (k,) [m/s^2, rad/s^2]."""
        if self.relative_to is None:
            return super().drift(kinematics)
        own, root = kinematics.frame_id(self.frame), kinematics.frame_id(self.relative_to)
        turn, between = self._between(kinematics)
        base, omega = kinematics.frame_drift(root), kinematics.frame_velocity(root)[3:]
        rate = kinematics.frame_velocity(own) - kinematics.frame_velocity(root)
        relative = kinematics.frame_drift(own) - base
        relative[:3] -= np.cross(base[3:], between) + 2.0 * np.cross(omega, rate[:3])
        relative[:3] += np.cross(omega, np.cross(omega, between))
        relative[3:] -= np.cross(omega, rate[3:])
        relative[:3], relative[3:] = turn.T @ relative[:3], turn.T @ relative[3:]
        return relative[self.rows()]

    @property
    def state_rows(self) -> StateRows | None:
        """The rows of the frame where it is seen from the world."""
        if self.relative_to is not None:
            return None
        return StateRows(self.kind, self.frame, self.rows())

    def _between(self, kinematics: Kinematics) -> tuple[FloatArray, FloatArray]:
        """Return the rotation world-from-root (3, 3) and p - p_r in world axes (3,)."""
        root = kinematics.placement(kinematics.frame_id(self.relative_to or self.frame))
        own = kinematics.placement(kinematics.frame_id(self.frame))
        return root.rotation.copy(), own.translation - root.translation


def turn_missing(placement: pin.SE3, target: FloatArray) -> FloatArray:
    """Return R log3(R' R_target), (3,) [rad]: what turns the placement into the target."""
    rotation = placement.rotation
    turn: FloatArray = rotation.dot(pin.log3(rotation.T.dot(target)))
    return turn


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FramePositionTask(FrameTask, AxesTask):
    """Position of a frame's origin along some axes of the world, or of another frame [m]."""

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the origin along the axes, (k,) [m]."""
        return np.asarray(self.placement(kinematics).translation[self.rows()])


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FrameOrientationTask(FrameTask, AxesTask):
    """Orientation of a frame; the value is its rotation matrix (3, 3), world from frame.

    The error is the rotation vector R log3(R' R_target) in world axes [rad], of which the task
    takes the components along its axes, "y" for the pitch of a planar robot. Relative to another
    frame, that frame stands for the world.
    """

    turns: ClassVar[bool] = True

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the rotation matrix, world from frame, (3, 3)."""
        return np.asarray(self.placement(kinematics).rotation)

    def admitted(self, target: Target, size: int) -> FloatArray:
        """Return a rotation matrix (3, 3), checked and copied."""
        return rotation_target(target)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return the components of R log3(R' R_target), world axes, (k,) [rad]."""
        return turn_missing(self.placement(kinematics), target)[axis_rows(self.axes, self.name)]

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target (3, 3) as the rotation of a placement (12,)."""
        place[:9] = target.T.reshape(-1)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class FramePoseTask(FrameTask):
    """Pose of a frame; the value is a `pin.SE3`, world from frame.

    Rows are the position's error [m] over the rotation vector R log3(R' R_target) [rad], both in
    world axes. Relative to another frame, that frame stands for the world.
    """

    def rows(self) -> slice:
        """Return all six rows."""
        return slice(0, 6)

    def value(self, kinematics: Kinematics) -> pin.SE3:
        """Return the placement, world from frame."""
        return self.placement(kinematics).copy()

    def admitted(self, target: Target, size: int) -> pin.SE3:
        """Return a `pin.SE3`, checked and copied."""
        return pose_target(target)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return [p_target - p; R log3(R' R_target)], world axes, (6,)."""
        placement = self.placement(kinematics)
        away = target.translation - placement.translation
        return np.concatenate([away, turn_missing(placement, target.rotation)])

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target as a placement (12,)."""
        place[:9], place[9:] = target.rotation.T.reshape(-1), target.translation


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

    def check(self, robot: Robot) -> int:
        """Return 1."""
        require_frame(robot, self.frame, self.name)
        require_frame(robot, self.other, self.name)
        return 1

    def rows(self) -> slice:
        """Return the one row."""
        return slice(0, 1)

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the distance, (1,) [m]."""
        one, other = kinematics.frame_id(self.frame), kinematics.frame_id(self.other)
        start = kinematics.placement(one).translation.copy()
        apart = kinematics.placement(other).translation - start
        return np.array([max(float(np.linalg.norm(apart)), NO_DISTANCE)])

    @property
    def state_rows(self) -> StateRows:
        """The rate of the distance."""
        return StateRows(self.kind, self.frame, self.rows(), other=self.other)
