"""What tasks on frames share: a frame, seen from the world or from another frame."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics, RowKind, StateRows
from wbc.control.tasks.frames import require_frame
from wbc.control.tasks.task import Task
from wbc.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameTask(Task):
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

    def check(self, robot: Robot) -> int:
        """Return the number of rows; raise ControlError where a frame is missing."""
        require_frame(robot, self.frame, self.name)
        if self.relative_to is not None:
            require_frame(robot, self.relative_to, self.name)
        return len(range(*self.rows().indices(6)))

    @abstractmethod
    def rows(self) -> slice:
        """Return which of the six rows, linear over angular, the task has."""

    def placement(self, kinematics: Kinematics) -> pin.SE3:
        """Return the frame's placement in the world or in the frame it is seen from."""
        own = kinematics.placement(kinematics.frame_id(self.frame))
        if self.relative_to is None:
            return own
        return kinematics.placement(kinematics.frame_id(self.relative_to)).actInv(own)

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of the frame's Jacobian, (k, nv)."""
        own = kinematics.frame_jacobian(kinematics.frame_id(self.frame))
        if self.relative_to is None:
            return own[self.rows()]
        root = kinematics.frame_id(self.relative_to)
        turn, between = self._between(kinematics)
        base = kinematics.frame_jacobian(root)
        relative = own - base
        relative[:3] += pin.skew(between) @ base[3:]
        relative[:3], relative[3:] = turn.T @ relative[:3], turn.T @ relative[3:]
        return relative[self.rows()]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of dJ/dt v, (k,) [m/s^2, rad/s^2]."""
        own = kinematics.frame_drift(kinematics.frame_id(self.frame))
        if self.relative_to is None:
            return own[self.rows()]
        root = kinematics.frame_id(self.relative_to)
        turn, between = self._between(kinematics)
        base = kinematics.frame_drift(root)
        rate = kinematics.frame_velocity(kinematics.frame_id(self.frame))
        omega, rate = kinematics.frame_velocity(root)[3:], rate - kinematics.frame_velocity(root)
        relative = own - base
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
        return StateRows(RowKind.FRAME, self.frame, self.rows())

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
