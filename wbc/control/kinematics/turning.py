"""The rotation vector between two placements, compiled."""

from __future__ import annotations

from math import atan2, sqrt

from wbc.arrays import FloatArray
from wbc.compiled import Nothing, OutVector, Vector, compiled


@compiled(Nothing, Vector, Vector, OutVector)
def place_turn(place: FloatArray, target: FloatArray, turn: FloatArray) -> None:
    """Write log3(R_target R') (3,) [rad], world axes: what turns a placement into its target.

    By way of the unit quaternion of the largest component (Shepperd, 1978), which is exact for
    small turns and for turns of nearly pi.

    Args:
        place, target: rotation, column by column, and translation (12,).
        turn: result.
    """
    # M = R_target R', both given column by column
    m00 = target[0] * place[0] + target[3] * place[3] + target[6] * place[6]
    m01 = target[0] * place[1] + target[3] * place[4] + target[6] * place[7]
    m02 = target[0] * place[2] + target[3] * place[5] + target[6] * place[8]
    m10 = target[1] * place[0] + target[4] * place[3] + target[7] * place[6]
    m11 = target[1] * place[1] + target[4] * place[4] + target[7] * place[7]
    m12 = target[1] * place[2] + target[4] * place[5] + target[7] * place[8]
    m20 = target[2] * place[0] + target[5] * place[3] + target[8] * place[6]
    m21 = target[2] * place[1] + target[5] * place[4] + target[8] * place[7]
    m22 = target[2] * place[2] + target[5] * place[5] + target[8] * place[8]
    trace = m00 + m11 + m22
    if trace >= m00 and trace >= m11 and trace >= m22:
        w, x, y, z = 1.0 + trace, m21 - m12, m02 - m20, m10 - m01
    elif m00 >= m11 and m00 >= m22:
        w, x, y, z = m21 - m12, 1.0 + 2.0 * m00 - trace, m01 + m10, m02 + m20
    elif m11 >= m22:
        w, x, y, z = m02 - m20, m01 + m10, 1.0 + 2.0 * m11 - trace, m12 + m21
    else:
        w, x, y, z = m10 - m01, m02 + m20, m12 + m21, 1.0 + 2.0 * m22 - trace
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = sqrt(x * x + y * y + z * z)
    scale = 2.0 / w if sine <= 1e-9 * w else 2.0 * atan2(sine, w) / sine
    turn[0], turn[1], turn[2] = scale * x, scale * y, scale * z
