"""The ellipsoid of an inertia tensor, to draw it and to name its heavy direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, checked, frozen
from wbc.errors import DynamicsError


@dataclass(frozen=True, eq=False)
class InertiaEllipsoid:
    """Principal inertias of a contact point and the ellipsoid x' S x = 1 that shows them.

    S is the symmetric part of the tensor: x' G x does not see the rest.

    Attributes:
        inertia: (n,) principal inertias [kg], heaviest first.
        directions: (n, n), one unit vector per column, in the same order.
        semi_axes: (n,) 1/sqrt(inertia) [kg^-1/2], shortest first.
    """

    inertia: FloatArray
    directions: FloatArray
    semi_axes: FloatArray


def inertia_ellipsoid(tensor: FloatArray) -> InertiaEllipsoid:
    """Return the ellipsoid of an inertia tensor (n, n) [kg].

    Raises:
        DynamicsError: a tensor whose symmetric part is not positive definite, as a Forward-GIT's
            can be when its efficiencies lie very far apart.
    """
    size = np.asarray(tensor).shape[0] if np.ndim(tensor) else 0
    square = checked(tensor, (size, size), "inertia tensor", DynamicsError)
    values, vectors = np.linalg.eigh(0.5 * (square + square.T))
    if values.size == 0 or values[0] <= 0.0:
        raise DynamicsError("the symmetric part of the inertia tensor has no ellipsoid.")
    heavy_first = values[::-1]
    return InertiaEllipsoid(
        frozen(heavy_first), frozen(vectors[:, ::-1]), frozen(1.0 / np.sqrt(heavy_first))
    )
