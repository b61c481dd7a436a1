"""Targets as tasks need them: checked, and copied from memory that the caller may use again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, reals
from wbc.compiled import Matrix, Number, compiled
from wbc.errors import ControlError

_FLOAT = np.dtype(np.float64)
_TURNED = 1e-4  # single precision leaves 1e-7, four printed digits 1e-4


def vector_target(target: Any, size: int) -> FloatArray:
    """Return a target as a new array (size,).

    Raises:
        ControlError: another shape, or no numbers.
    """
    if type(target) is np.ndarray and target.dtype is _FLOAT and target.shape == (size,):
        return target.copy()
    try:
        values = reals(target)
    except (TypeError, ValueError) as cause:
        raise ControlError(f"position must be an array ({size},): {cause}") from cause
    if values.shape != (size,):
        raise ControlError(f"position has shape {values.shape}, expected ({size},)")
    return values


def number_target(target: Any) -> float:
    """Return a target as a number; an array of one number is one.

    Raises:
        ControlError: no number, or several.
    """
    if type(target) is float:
        return target
    try:
        values = reals(target)
    except (TypeError, ValueError) as cause:
        raise ControlError(f"position must be a number: {cause}") from cause
    if values.size != 1:
        raise ControlError(f"position has shape {values.shape}, expected a number")
    return float(values.reshape(-1)[0])


def rotation_target(target: Any) -> FloatArray:
    """Return a target as a new rotation matrix (3, 3).

    Raises:
        ControlError: another shape, or a matrix that is no rotation. One that is not finite
            passes, so that it is named as such.
    """
    try:
        matrix = reals(target)
    except (TypeError, ValueError) as cause:
        raise ControlError(f"position must be a rotation matrix (3, 3): {cause}") from cause
    if matrix.shape != (3, 3):
        raise ControlError(
            f"position has shape {matrix.shape}, expected a rotation matrix (3, 3); "
            "pin.rpy.rpyToMatrix makes one of roll, pitch and yaw"
        )
    if rotation_error(matrix) > _TURNED:
        raise ControlError("position is no rotation matrix: R'R = 1 and det R = 1 do not hold")
    return matrix


def pose_target(target: Any) -> pin.SE3:
    """Return a target as a new `pin.SE3`.

    Raises:
        ControlError: something else, or one whose matrix is no rotation.
    """
    if not isinstance(target, pin.SE3):
        raise ControlError(f"position must be a pin.SE3, got {type(target).__name__}")
    rotation_target(target.rotation)
    return target.copy()


@compiled(Number, Matrix)
def rotation_error(matrix: FloatArray) -> float:
    """Return the largest entry of |R'R - 1|, at least 2 for a reflection; NaN where R has one."""
    worst = 0.0
    for i in range(3):
        for j in range(3):
            product = 0.0
            for k in range(3):
                product += matrix[k, i] * matrix[k, j]
            worst = max(worst, abs(product - (1.0 if i == j else 0.0)))
    a, b, c = matrix[0], matrix[1], matrix[2]
    turn = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
    turn += a[2] * (b[0] * c[1] - b[1] * c[0])
    return worst if turn > 0.0 or not turn < 0.0 else max(worst, 2.0)
