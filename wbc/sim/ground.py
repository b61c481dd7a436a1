"""Contact rows: which points touch, and their normal and tangent directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics import Workspace

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def contact_points(space: Workspace) -> FloatArray:
    """Return the positions (k, 3) of the contact points for the kinematics held in `space`."""
    model, data = space.model, space.data
    points = np.empty((len(space.frames), 3))
    for i, frame in enumerate(space.frames):
        points[i] = pin.updateFramePlacement(model, data, frame).translation
    return points


@dataclass(frozen=True, eq=False, slots=True)
class ContactRows:
    """Jacobian rows of some contact points in their ground frames.

    Attributes:
        which: (c,) indices of the contacts.
        axes: (c, 1 + d, 3) unit vectors, the normal first, world.
        normals: (c, nv).
        tangents: (c d, nv).
    """

    which: IntArray
    axes: FloatArray
    normals: FloatArray
    tangents: FloatArray


def contact_rows(
    space: Workspace, which: IntArray, normal: FloatArray, planar: bool
) -> ContactRows:
    """Return the rows of contacts `which` for the Jacobians held in `space`.

    Args:
        space: workspace with joint Jacobians computed.
        which: (c,) contact indices.
        normal: (c, 3) unit normals.
        planar: whether the points move in x-z only, so that one tangent is enough.
    """
    d = 1 if planar else 2
    nv = space.model.nv
    axes = np.empty((len(which), 1 + d, 3))
    rows = np.empty((len(which), 1 + d, nv))
    for i, contact in enumerate(which):
        axes[i] = ground_axes(normal[i], planar)
        jacobian = pin.getFrameJacobian(space.model, space.data, space.frames[contact], _WORLD)
        rows[i] = axes[i] @ jacobian[:3]
    return ContactRows(which, axes, rows[:, 0], rows[:, 1:].reshape(-1, nv))


def ground_axes(normal: FloatArray, planar: bool) -> FloatArray:
    """Return normal and tangents (1 + d, 3) as unit vectors; in a plane the tangent along +x."""
    x, _, z = normal
    if planar:
        return np.array([normal, [z, 0.0, -x]])
    first = np.array([1.0, 0.0, 0.0]) if abs(x) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = first - (first @ normal) * normal
    first /= np.sqrt(first @ first)
    second = np.array(
        [
            normal[1] * first[2] - normal[2] * first[1],
            normal[2] * first[0] - normal[0] * first[2],
            normal[0] * first[1] - normal[1] * first[0],
        ]
    )
    return np.array([normal, first, second])


def moves_in_plane(space: Workspace) -> bool:
    """Return whether no contact point can leave its x-z plane, whatever the configuration."""
    model, data = space.model, space.data
    generator = np.random.default_rng(0)
    for _ in range(3):
        q = pin.integrate(model, pin.neutral(model), generator.uniform(-1.0, 1.0, model.nv))
        pin.computeJointJacobians(model, data, q)
        for frame in space.frames:
            pin.updateFramePlacement(model, data, frame)
            if np.abs(pin.getFrameJacobian(model, data, frame, _WORLD)[1]).max() > 1e-9:
                return False
    return True


def world_impulse(
    rows: ContactRows, normal: FloatArray, tangent: FloatArray, count: int
) -> FloatArray:
    """Return impulses (count, 3) in world axes from normal (c,) and tangential (c, d) parts."""
    total = np.zeros((count, 3))
    if len(rows.which):
        parts = np.concatenate((normal[:, None], tangent), axis=1)
        total[rows.which] = (parts[:, :, None] * rows.axes).sum(axis=1)
    return total
