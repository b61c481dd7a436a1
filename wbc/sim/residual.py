"""How far row impulses and speeds are from the laws of a step."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.sim.elements import meeting_speed
from wbc.sim.reduced import Reduced


def row_residual(reduced: Reduced, impulse: FloatArray, speed: FloatArray) -> FloatArray:
    """Return the natural residual (r,) of every row, as a speed; zero exactly at a solution.

    The line of slope `reduced.slope` through (speed, impulse) meets a monotone law in one point;
    the residual is the distance to it. For contacts this is Alart and Curnier's map: the normal
    is projected onto the half line, the tangents onto the disc of radius mu p_n.
    """
    program, m, slope = reduced.program, reduced.elements, reduced.slope
    point = impulse - slope * speed
    result = np.empty(len(impulse))
    result[:m] = meeting_speed(program.elements, point[:m], slope[:m]) - speed[:m]
    if len(impulse) == m:
        return result
    unilateral, rows = program.unilateral, reduced.normal_rows
    push = np.maximum(point[rows] + slope[rows] * unilateral.target, 0.0)
    result[rows] = (push - impulse[rows]) / slope[rows]
    k, d = reduced.contacts, reduced.tangents
    if d:
        tangent = reduced.tangent_rows
        wish = point[tangent].reshape(k, d)
        size = np.sqrt((wish * wish).sum(axis=1))
        bound = push[reduced.limits :] * unilateral.friction
        outside = size > bound
        scale = np.where(outside, bound / np.where(outside, size, 1.0), 1.0)
        short = (wish * scale[:, None]).ravel() - impulse[tangent]
        result[tangent] = short / slope[tangent]
    return result
