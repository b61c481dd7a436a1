"""Where single joints should be."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.control.kinematics import Kinematics
from wbc.control.reference import Target
from wbc.control.rows.task import Task
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

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value, (k,)."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the selection of the joints' rows, (k, nv)."""
        return self._jacobian

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return zeros, (k,)."""
        return np.zeros(len(self.joints))
