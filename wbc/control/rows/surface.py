"""A flat sole that rests on the ground: forces, centre of pressure and yaw torque."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import final

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from wbc.arrays import FloatArray, frozen
from wbc.control.kinematics import StateRows
from wbc.control.rows.contacts import BoundContact, Cone, ConeApproximation, Contact
from wbc.control.tree import RowKind
from wbc.errors import ControlError
from wbc.robot import Robot

_FLAT = 1e-6  # [m] that corners written with six decimals are off


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceContact(Contact):
    """A convex sole between some of the robot's contact points, in the x-y plane of a frame.

    The wrench (6,) is force over torque at the mean of the corners, along the frame's axes, z away
    from the ground. It can be borne if it is the sum of forces at the corners, each in its friction
    pyramid: friction, centre of pressure, and the yaw torque that friction leaves are the faces of
    that cone, found by Qhull. For a rectangle they are the sixteen rows of Caron, Pham & Nakamura
    (ICRA 2015).

    Attributes:
        corners: names of the contact points, three or more, in any order.
        approximation: whether the four-sided pyramids stand inside the cone or around it.
    """

    corners: tuple[str, ...]
    approximation: ConeApproximation = ConeApproximation.INNER

    def _check_outline(self, corners: FloatArray) -> None:
        """Raise ControlError unless all corners (n, 2) are corners of their convex hull."""
        try:
            used = ConvexHull(corners).vertices
        except QhullError:
            used = np.zeros(0, dtype=np.int_)
        for i in range(len(corners)):
            if i not in used:
                raise ControlError(
                    f"contact '{self.name}': '{self.corners[i]}' lies between the other corners."
                )

    def bind(self, robot: Robot) -> BoundContact:
        """Return the contact with its placement and its cone.

        Raises:
            ControlError: fewer than three corners, corners in several frames, not in one plane
                z = const., or one that lies between the others.
            RobotError: no such contact point.
        """
        points = [robot.contact(name) for name in self.corners]
        if len(points) < 3:
            raise ControlError(f"contact '{self.name}': a surface has at least three corners.")
        if len({point.frame for point in points}) > 1:
            raise ControlError(
                f"contact '{self.name}': the corners sit in several frames: "
                + ", ".join(f"'{p.name}' in '{p.frame}'" for p in points)
            )
        offsets = np.array([point.offset for point in points])
        middle = offsets.mean(axis=0)
        if np.ptp(offsets[:, 2]) > _FLAT:
            raise ControlError(
                f"contact '{self.name}': the corners lie in no plane along x and y of "
                f"'{points[0].frame}'."
            )
        self._check_outline(offsets[:, :2])
        mu = min(p.friction for p in points) if self.friction is None else self.friction
        slope = mu / np.sqrt(2.0) if self.approximation is ConeApproximation.INNER else mu
        around = (offsets - middle)[:, :2]
        matrix, labels = polygon_cone(slope, around)
        normal = np.zeros(6)
        normal[2] = 1.0
        number, name = robot.model.getFrameId(points[0].frame), f"middle of {self.name}"
        parent = robot.model.frames[number]
        placement = parent.placement * pin.SE3(np.eye(3), middle)
        kind = pin.FrameType.OP_FRAME
        return BoundContact(
            contact=self,
            cone=Cone(frozen(matrix), labels, normal),
            axes=frozen(np.arange(6), np.int_),
            size=6,
            state_rows=StateRows(RowKind.OWN, name, slice(0, 6)),
            corners=offsets - middle,
            frames=(pin.Frame(name, parent.parentJoint, number, placement, kind),),
        )


def polygon_cone(friction: float, corners: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Return rows (p, 6) <= 0 on [f, tau] that a convex polygon can bear, and their names.

    The wrenches of normal force one are the convex hull of those of the edges of all corners'
    pyramids; its faces are the rows.

    Args:
        friction: slope of the four-sided pyramids, > 0.
        corners: (n, 2) [m] about the point of the wrench.

    Raises:
        ControlError: without friction the cone has no inside.
    """
    if not friction > 0.0:
        raise ControlError("a polygonal sole needs friction > 0.")
    reach = float(np.abs(corners).max())
    edges = []
    for (x, y), a, b in product(corners, (1.0, -1.0), (1.0, -1.0)):
        fx, fy = a * friction, b * friction
        edges.append([fx, fy, y / reach, -x / reach, (x * fy - y * fx) / reach])
    found = np.unique(np.round(ConvexHull(np.array(edges)).equations, 9), axis=0)
    rows = found[:, [0, 1, 5, 2, 3, 4]]
    rows[:, 3:] /= reach
    labels = []
    for row in rows:
        turns, tilts = abs(row[5]) > 0.0, np.abs(row[3:5]).max() > 0.0
        labels.append("yaw torque" if turns else "centre of pressure" if tilts else "friction")
        # a violation is in N, or in N m
        row /= abs(row[5]) if turns else np.abs(row[3:5]).max() if tilts else 1.0
    return rows, tuple(labels)
