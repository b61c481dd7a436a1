"""A flat rectangle that rests on the ground: forces, centre of pressure and yaw torque."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, frozen
from wbc.control.contacts.contact import BoundContact, Cone, Contact
from wbc.control.contacts.friction import ConeApproximation
from wbc.control.kinematics import Kinematics
from wbc.errors import ControlError
from wbc.robot import Robot


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceContact(Contact):
    """A rectangular sole between four of the robot's contact points, in the x-y plane of a frame.

    The wrench (6,) is force over torque at the middle of the rectangle, along the frame's axes,
    z away from the ground. It can be borne if it is the sum of forces at the four corners, each
    in its friction pyramid; that set is given by the sixteen rows of Caron, Pham & Nakamura
    (ICRA 2015): friction, centre of pressure, and the yaw torque that friction leaves.

    Attributes:
        corners: names of the four contact points.
        approximation: whether the four-sided pyramids stand inside the cone or around it.
    """

    corners: tuple[str, ...]
    approximation: ConeApproximation = ConeApproximation.INNER

    def bind(self, robot: Robot) -> BoundSurface:
        """Return the contact with its placement and its cone.

        Raises:
            ControlError: other than four corners, in several frames, or no rectangle.
            RobotError: no such contact point.
        """
        points = [robot.contact(name) for name in self.corners]
        if len(points) != 4:
            raise ControlError(f"contact '{self.name}': a surface has four corners.")
        if len({point.frame for point in points}) > 1:
            raise ControlError(
                f"contact '{self.name}': the corners sit in several frames: "
                + ", ".join(f"'{p.name}' in '{p.frame}'" for p in points)
            )
        offsets = np.array([point.offset for point in points])
        middle = offsets.mean(axis=0)
        half = np.abs(offsets - middle)
        if np.ptp(half, axis=0).max() > 1e-6 or half[0, 2] > 1e-6 or half[0, :2].min() < 1e-6:
            raise ControlError(
                f"contact '{self.name}': the corners span no rectangle along x and y of "
                f"'{points[0].frame}'."
            )
        mu = min(p.friction for p in points) if self.friction is None else self.friction
        slope = mu / np.sqrt(2.0) if self.approximation is ConeApproximation.INNER else mu
        matrix, labels = wrench_cone(slope, float(half[0, 0]), float(half[0, 1]))
        normal = np.zeros(6)
        normal[2] = 1.0
        return BoundSurface(
            contact=self,
            rows=6,
            cone=Cone(frozen(matrix), labels, normal),
            frame=points[0].frame,
            middle=frozen(middle),
        )


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class BoundSurface(BoundContact):
    """A surface contact resolved on a robot.

    Attributes:
        frame: the frame it sits in.
        middle: (3,) [m] of the rectangle in that frame.
    """

    frame: str
    middle: FloatArray

    @property
    def _middle_frame(self) -> str:
        return f"middle of {self.name}"

    def frames(self, model: pin.Model) -> tuple[pin.Frame, ...]:
        """Return the frame at the rectangle's middle."""
        number = model.getFrameId(self.frame)
        parent = model.frames[number]
        placement = parent.placement * pin.SE3(np.eye(3), np.array(self.middle))
        kind = pin.FrameType.OP_FRAME
        return (pin.Frame(self._middle_frame, parent.parentJoint, number, placement, kind),)

    def fill(self, kinematics: Kinematics, jacobian: FloatArray, drift: FloatArray) -> None:
        """Write the spatial Jacobian and acceleration at the rectangle's middle, its own axes."""
        number = kinematics.frame_id(self._middle_frame)
        local = pin.ReferenceFrame.LOCAL
        jacobian[:] = kinematics.frame_jacobian(number, local)
        drift[:] = pin.getFrameAcceleration(kinematics.model, kinematics.data, number, local).vector

    def wrench(self, force: FloatArray) -> FloatArray:
        """Return the wrench (6,) [N, N m] at the middle, along the frame's axes."""
        return force


def wrench_cone(friction: float, length: float, width: float) -> tuple[FloatArray, tuple[str, ...]]:
    """Return rows (16, 6) <= 0 on [f, tau] that a rectangle can bear, and their names.

    Args:
        friction: slope of the four-sided pyramids, |fx| and |fy| at most friction * fz.
        length: half the side along x [m].
        width: half the side along y [m].
    """
    rows: list[list[float]] = []
    labels: list[str] = []
    for sign in (1.0, -1.0):
        rows.append([sign, 0, -friction, 0, 0, 0])
        rows.append([0, sign, -friction, 0, 0, 0])
        rows.append([0, 0, -width, sign, 0, 0])
        rows.append([0, 0, -length, 0, sign, 0])
        labels += ["friction along x", "friction along y"]
        labels += ["centre of pressure along y", "centre of pressure along x"]
    reach = friction * (length + width)
    for a, b, upper in product((1.0, -1.0), (1.0, -1.0), (True, False)):
        # |tau_z| is left what sideways forces and tilting torques have not used of the friction.
        side = 1.0 if upper else -1.0
        torque = side * friction
        rows.append([a * width, b * length, -reach, a * torque, b * torque, side])
        labels.append("yaw torque")
    return np.array(rows, dtype=np.float64), tuple(labels)
