"""Spatial inertia of a link as its ten parameters, in which masses simply add."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray


def point_mass(mass: float, point: FloatArray) -> FloatArray:
    """Return the ten parameters of a point mass, pinocchio's order.

    The order is [m, m c, Ixx, Ixy, Iyy, Ixz, Iyz, Izz], moments about the frame's origin.

    Args:
        mass: [kg].
        point: (3,) [m] in the frame.
    """
    x, y, z = point
    about_origin = [y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y]
    return mass * np.array([1.0, x, y, z, *about_origin])


def add_point_mass(inertia: pin.Inertia, mass: float, point: FloatArray) -> pin.Inertia:
    """Return `inertia` with a point mass added (a negative one taken away)."""
    return pin.Inertia.FromDynamicParameters(
        inertia.toDynamicParameters() + point_mass(mass, point)
    )
