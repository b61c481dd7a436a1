"""Coulomb's cone as a polyhedron."""

from __future__ import annotations

from enum import Enum

import numpy as np

from wbc.arrays import FloatArray


class ConeApproximation(Enum):
    """How a pyramid stands to the cone: wholly inside it, or around it."""

    INNER = "inner"
    OUTER = "outer"


def pyramid(friction: float, faces: int, approximation: ConeApproximation) -> FloatArray:
    """Return rows (faces, 3) with rows @ [fx, fy, fz] <= 0, the linearised friction cone.

    The outer pyramid's faces touch the cone, the inner one's edges lie on it (its slope is mu
    cos(pi/faces)). The first face looks along x, so that four faces bound |fx| and |fy|.

    Args:
        friction: mu >= 0.
        faces: number of faces, at least 3.
        approximation: INNER or OUTER.
    """
    angles = 2.0 * np.pi * np.arange(faces) / faces
    inside = approximation is ConeApproximation.INNER
    slope = friction * (np.cos(np.pi / faces) if inside else 1.0)
    return np.column_stack([np.cos(angles), np.sin(angles), np.full(faces, -slope)])


def planar_cone(friction: float, axes: int) -> FloatArray:
    """Return rows with rows @ [f_t, f_z] <= 0 for one tangential axis, or none for f_z alone."""
    if axes == 1:
        return np.zeros((0, 1))
    return np.array([[1.0, -friction], [-1.0, -friction]])
