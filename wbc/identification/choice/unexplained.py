"""How much may be left of an error before the cause must lie outside the list."""

from __future__ import annotations

import numpy as np

from wbc.identification.choice.hypothesis import Model
from wbc.identification.model.problem import Problem

_UNEXPLAINED_FLOOR = 1.0  # rms excess over the floor, in floors, that counts as unexplained
# A link that bounces in its play is chaotic: no simulation follows it for long.
_UNEXPLAINED_SHARE_SIMULATED = 0.1
_UNEXPLAINED_SHARE = 0.05  # ... and as a share of the first excess
_UNEXPLAINED_MOST = 25.0  # ... and in floors, beyond ...
_DISTORTED = 0.01  # ... the share of the first excess that filters and derivatives distort
_UNEXPLAINED_TORQUE = 0.3  # ... and as a share of the torque itself


def unexplained(problem: Problem, before: float, final: Model) -> bool:
    """Whether so much is left that the cause must lie outside the candidates."""
    left = np.sqrt(max(final.error - 1.0, 0.0))
    first = np.sqrt(max(before - 1.0, 0.0))
    bouncing = final.swings
    share = _UNEXPLAINED_SHARE_SIMULATED if bouncing else _UNEXPLAINED_SHARE
    largest = _UNEXPLAINED_MOST + _DISTORTED * first
    most = min(share * first, largest, _UNEXPLAINED_TORQUE * problem.torque_in_floors)
    return bool(left > max(_UNEXPLAINED_FLOOR, most))
