"""What the controller believes of gears near standstill, compiled."""

from __future__ import annotations

from wbc.arrays import FloatArray
from wbc.control.compiled import Flag, Nothing, Number, OutVector, Vector, compiled


@compiled(Nothing, Vector, Vector, Number, Number, OutVector)
def place_corrected(
    expected: FloatArray, measured: FloatArray, trusted: float, kept: float, corrected: FloatArray
) -> None:
    """Write measured - kept clip(measured - expected, +-trusted) (k,) into `corrected`."""
    for i in range(len(measured)):
        error = min(max(measured[i] - expected[i], -trusted), trusted)
        corrected[i] = measured[i] - kept * error


@compiled(Nothing, Vector, Number, OutVector)
def place_certainty(speed: FloatArray, full: float, certainty: FloatArray) -> None:
    """Write clip(speed / full, +-1) (k,) into `certainty`."""
    for i in range(len(speed)):
        certainty[i] = min(max(speed[i] / full, -1.0), 1.0)


@compiled(Nothing, *[Vector] * 5, OutVector)
def place_mesh_input(
    output: FloatArray,
    sigma: FloatArray,
    rest: FloatArray,
    forward: FloatArray,
    backward: FloatArray,
    mesh: FloatArray,
) -> None:
    """Write t = ((1 - |sigma|) rest + |sigma| (forward or backward)) T (m,) into `mesh`.

    Args:
        output: T (m,).
        sigma: certainty of direction (m,).
        rest, forward, backward: slopes (m,) at standstill, where T sigma > 0, and elsewhere.
        mesh: result.
    """
    for i in range(len(output)):
        moving = forward[i] if output[i] * sigma[i] > 0.0 else backward[i]
        mesh[i] = (rest[i] + abs(sigma[i]) * (moving - rest[i])) * output[i]


@compiled(Flag, *[Vector] * 4, OutVector, OutVector)
def place_within(
    mesh: FloatArray,
    share: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    wanted: FloatArray,
    clipped: FloatArray,
) -> bool:
    """Write mesh + share (m,) into `wanted` and what the limits leave of it into `clipped`.

    Returns:
        whether the limits leave all of it.
    """
    whole = True
    for i in range(len(mesh)):
        wanted[i] = mesh[i] + share[i]
        clipped[i] = min(max(wanted[i], lower[i]), upper[i])
        whole = whole and clipped[i] == wanted[i]
    return whole
