"""Impact mitigation factor: what share of an impact the gears let the legs give way to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, frozen
from wbc.metrics.contact_task import ContactTask, contact_task
from wbc.robot import Robot
from wbc.transmission import Direction


@dataclass(frozen=True, eq=False)
class ImpactMitigation:
    """The impact mitigation of one contact point in one pose (Wensing et al. 2017).

    Xi = I - Lambda Lambda_L^-1 with Lambda the inertia felt by an impact and Lambda_L that of the
    same robot with its gears blocked. 1 is a leg that gives way freely, 0 a rigid one.

    Attributes:
        task: the contact point and pose.
        free: Lambda^-1 (n, n) [1/kg].
        blocked: Lambda_L^-1 (n, n) [1/kg]; zero on a fixed base, which a blocked leg cannot move.
    """

    task: ContactTask
    free: FloatArray
    blocked: FloatArray

    @cached_property
    def matrix(self) -> FloatArray:
        """Xi = I - Lambda Lambda_L^-1, (n, n).

        Raises:
            DynamicsError: a singular pose, in which some direction meets infinite inertia.
        """
        inertia = self.task.inverted(self.free, "the impact mitigation")
        return frozen(np.eye(len(inertia)) - inertia @ self.blocked)

    @property
    def determinant(self) -> float:
        """det Xi, the factor over all axes at once."""
        return float(np.linalg.det(self.matrix))

    def along(self, direction: ArrayLike) -> float:
        """Return 1 - (n' Lambda_L^-1 n)/(n' Lambda^-1 n) for a frictionless impact along n.

        Args:
            direction: (n,) along the task's axes, of any length.

        Raises:
            DynamicsError: a direction in which the point cannot move at all.
        """
        n = self.task.direction(direction)
        give = self.task.inverted(np.atleast_2d(n @ self.free @ n), "the impact mitigation")
        return float(1.0 - (n @ self.blocked @ n) * give[0, 0])


def impact_mitigation(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    axes: str = "xyz",
    directions: ArrayLike = Direction.BACKWARD,
) -> ImpactMitigation:
    """Return the impact mitigation at a contact point.

    Args:
        robot: fixed or floating base. On a fixed base nothing moves when the gears are blocked:
            the factor is 1 whatever the gears.
        position: q (nq,).
        contact: name of the contact point.
        axes: world axes of the n rows, for example "xz" for a planar contact.
        directions: of power per gear, (m,) or one for all. An impact that sets the gears in
            motion drives them backward; 0 is the conservative factor without losses.

    Raises:
        DynamicsError: axes that do not exist, a position of wrong shape or not finite.
    """
    task = contact_task(robot, position, contact, axes)
    free = task.mobility(directions)
    rest = robot.unactuated
    across = task.jacobian[:, rest]
    base = task.terms.mass_matrix[np.ix_(rest, rest)]
    blocked = across @ np.linalg.solve(base, across.T) if rest.size else np.zeros_like(free)
    return ImpactMitigation(task, frozen(free), frozen(blocked))
