"""A point that rests on the ground, level or sloped."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray, checked, frozen
from wbc.control.contacts.contact import BoundContact, Cone, Contact
from wbc.control.contacts.friction import ConeApproximation, planar_cone, pyramid
from wbc.control.kinematics import RowKind, StateRows
from wbc.control.selection import Rows, as_rows
from wbc.dynamics import Workspace, evaluate
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class PointContact(Contact):
    """One of the robot's contact points on flat ground, force (3,) along the world axes.

    A contact point with a radius is the centre of a ball that rolls without slipping: at rest is
    the point of the ball that touches, and the force acts there. `stiffness` then keeps the height
    of the ball alone.

    Axes in which the robot can never move the point (y of a planar robot) get neither rows nor
    forces, so that no row of the program is singular by construction. On a slope the rows stay
    along the world axes; friction and the normal force lean with the ground.

    Attributes:
        ground_normal: direction (3,) away from the ground, world axes, of any length; straight
            up when left out.
        faces: faces of the friction pyramid, at least 3; a planar robot's cone is exact.
        approximation: whether the pyramid stands inside the cone or around it.
    """

    ground_normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    faces: int = 4
    approximation: ConeApproximation = ConeApproximation.INNER

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if self.faces < 3:
            raise ControlError(f"contact '{self.name}': a pyramid has at least 3 faces.")
        normal = checked(
            self.ground_normal, (3,), f"contact '{self.name}': ground_normal", ControlError
        )
        if not normal[2] > 0.0:
            raise ControlError(f"contact '{self.name}': ground_normal must point up, z > 0.")

    def bind(self, robot: Robot) -> BoundPoint:
        """Return the contact with its movable axes and its cone.

        Raises:
            ControlError: the point cannot move up and down, so that no force supports it, or the
                ground leans in a direction in which the robot cannot move.
            RobotError: no such contact point.
        """
        point = robot.contact(self.name)
        index = [c.name for c in robot.contacts].index(self.name)
        axes = movable_axes(robot, index)
        if 2 not in axes:
            raise ControlError(f"contact '{self.name}' cannot move along z on '{robot.name}'.")
        mu = point.friction if self.friction is None else self.friction
        if len(axes) == 3:
            matrix = pyramid(mu, self.faces, self.approximation)
        else:
            matrix = planar_cone(mu, len(axes))
        turn = self._ground_axes(axes)
        labels = tuple(f"friction cone, face {i}" for i in range(len(matrix)))
        cone = Cone(frozen(matrix @ turn), labels, frozen(turn[-1]))
        return BoundPoint(
            contact=self,
            rows=len(axes),
            cone=cone,
            axes=frozen(axes, np.int_),
            frame=f"contact:{self.name}",
            select=as_rows(np.asarray(axes)),
            arm=self._arm(point.radius),
        )

    def _arm(self, radius: float) -> tuple[float, float, float]:
        """Return the vector from where a ball touches the ground to its centre [m]."""
        normal = np.array(self.ground_normal)
        x, y, z = (radius / np.linalg.norm(normal) * normal).tolist()
        return x, y, z

    def _ground_axes(self, axes: list[int]) -> FloatArray:
        """Return two tangents and the normal of the ground as rows over the movable axes."""
        normal = np.array(self.ground_normal)
        normal /= np.linalg.norm(normal)
        fixed = [axis for axis in range(3) if axis not in axes]
        if np.abs(normal[fixed]).max(initial=0.0) > 1e-9:
            raise ControlError(
                f"contact '{self.name}': ground_normal leans along {'xyz'[fixed[0]]}, in which "
                "the robot cannot move."
            )
        along = np.array([normal[2], 0.0, -normal[0]])
        along /= np.linalg.norm(along)
        return np.array([along, np.cross(normal, along), normal])[np.ix_(axes, axes)]


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class BoundPoint(BoundContact):
    """A point contact resolved on a robot.

    Attributes:
        axes: the world axes (k,) that it has, the last one z.
        frame: name of the point among the tick's frames.
        select: the same axes as rows of a velocity.
        arm: (3,) [m] world axes, from where a ball touches the ground to its centre.
    """

    axes: IntArray
    frame: str
    select: Rows
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def state_rows(self) -> StateRows:
        """The point's linear rows, those of the rolling ball where it has a radius."""
        chosen = self.axes
        step = int(chosen[1] - chosen[0]) if len(chosen) > 1 else 1
        rows = slice(int(chosen[0]), int(chosen[-1]) + 1, step)
        return StateRows(RowKind.FRAME, self.frame, rows, self.arm)

    @property
    def components(self) -> IntArray:
        """The world axes that it has, (k,)."""
        return self.axes

    def wrench(self, force: FloatArray) -> FloatArray:
        """Return the force (3,) [N], world axes."""
        if self.rows == 3:
            return force
        result = np.zeros(3)
        result[self.select] = force
        return result


def movable_axes(robot: Robot, index: int) -> list[int]:
    """Return the world axes in which any motion of the robot moves a contact point.

    Judged at a few configurations spread over the joints' range, by a Jacobian row that is zero
    at all of them.
    """
    generator = np.random.default_rng(0)
    space = Workspace(robot)
    reach = np.zeros(3)
    for _ in range(5):
        step = generator.uniform(-1.0, 1.0, robot.model.nv)
        q = pin.integrate(robot.model, robot.neutral(), step)
        rows = evaluate(robot, q, np.zeros(robot.model.nv), space).contact_jacobian
        reach = np.maximum(reach, np.abs(rows[3 * index : 3 * index + 3]).max(axis=1))
    return [axis for axis in range(3) if reach[axis] > 1e-9]
