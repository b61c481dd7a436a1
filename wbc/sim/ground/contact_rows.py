"""Contact rows: which points touch, and their normal and tangent directions."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics import Workspace
from wbc.sim.solve.solution import StepSolution

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

_IN_PLANE = np.array([[1.0, 0, 0, 0, 0, -1], [0, 1, 0, 0, 0, 0], [0, 0, 1, 1, 0, 0]])
"""A normal (x, y, z) times this is (x, y, z, z, 0, -x): the normal and its tangent."""


def contact_points(space: Workspace) -> FloatArray:
    """Return the positions (k, 3) of the contact points for the kinematics held in `space`."""
    model, data = space.model, space.data
    points = np.empty((len(space.frames), 3))
    for i, frame in enumerate(space.frames):
        points[i] = pin.updateFramePlacement(model, data, frame).translation
    return points


@dataclass(frozen=True, eq=False, slots=True)
class ContactRows:
    """Jacobian rows of some contacts in their ground frames.

    Attributes:
        points: (c,) which of the robot's contacts they belong to.
        axes: (c, 1 + d, 3) unit vectors, the normal first, world.
        rows: (c, 1 + d, nv), velocity of the touching point along them.
    """

    points: IntArray
    axes: FloatArray
    rows: FloatArray


def contact_rows(
    space: Workspace, points: IntArray, normal: FloatArray, planar: bool
) -> ContactRows:
    """Return the rows of some contacts for the Jacobians held in `space`.

    A ball touches a radius below its centre: its point of contact turns with the link, and rolls.

    Args:
        space: workspace with joint Jacobians computed.
        points: (c,) indices of the robot's contacts; one of them may touch several solids.
        normal: (c, 3) unit normals of the ground there.
        planar: whether the points move in x-z only, so that one tangent is enough.
    """
    model, data, contacts = space.model, space.data, space.robot.contacts
    jacobian = np.empty((len(points), 3, model.nv))
    for i, point in enumerate(points.tolist()):
        # With one coordinate pinocchio returns a vector.
        whole = pin.getFrameJacobian(model, data, space.frames[point], _WORLD).reshape(6, -1)
        jacobian[i] = whole[:3]
        radius = contacts[point].radius
        if radius > 0.0:
            x, y, z = (radius * normal[i]).tolist()
            jacobian[i] += np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ whole[3:]
    axes = planar_axes(normal) if planar else spatial_axes(normal)
    return ContactRows(points, axes, axes @ jacobian)


def planar_axes(normal: FloatArray) -> FloatArray:
    """Return normal and tangent (k, 2, 3) as unit vectors in x-z; on level ground along +x."""
    return np.asarray(normal @ _IN_PLANE).reshape(-1, 2, 3)


def spatial_axes(normal: FloatArray) -> FloatArray:
    """Return normal and two tangents (k, 3, 3) as unit vectors; on level ground along x and y."""
    axes = np.empty((len(normal), 3, 3))
    for i, (x, y, z) in enumerate(normal.tolist()):
        # The world axis less its normal part: x, or y where x is nearly along the normal.
        along_x = abs(x) < 0.9
        first = (1.0 - x * x, -x * y, -x * z) if along_x else (-y * x, 1.0 - y * y, -y * z)
        size = hypot(*first)
        a, b, c = first[0] / size, first[1] / size, first[2] / size
        axes[i] = (x, y, z), (a, b, c), (y * c - z * b, z * a - x * c, x * b - y * a)
    return axes


def moves_in_plane(space: Workspace) -> bool:
    """Return whether no contact point can leave its x-z plane, whatever the configuration."""
    model, data = space.model, space.data
    generator = np.random.default_rng(0)
    for _ in range(3):
        q = pin.integrate(model, pin.neutral(model), generator.uniform(-1.0, 1.0, model.nv))
        pin.computeJointJacobians(model, data, q)
        for frame in space.frames:
            pin.updateFramePlacement(model, data, frame)
            whole = pin.getFrameJacobian(model, data, frame, _WORLD).reshape(6, -1)
            if np.abs(whole[[1, 3, 5]]).max() > 1e-9:
                return False
    return True


def world_impulse(contacts: ContactRows, count: int, solution: StepSolution) -> FloatArray:
    """Return impulses (k, 3) on all `count` contacts in world axes, for the rows of a solution."""
    total = np.zeros((count, 3))
    if len(contacts.points):
        normal = solution.normal_impulse[solution.reduced.limits :]
        parts = np.concatenate((normal[:, None], solution.tangent_impulse), axis=1)
        np.add.at(total, contacts.points, (parts[:, None] @ contacts.axes)[:, 0])
    return total
