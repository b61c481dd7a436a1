"""Where a recording shows an impact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray

_QUIET = 0.05


@dataclass(frozen=True)
class Impact:
    """A contact that closes on a moving robot.

    Attributes:
        time: [s].
        contact: its name.
        force: [N] largest force within 20 ms.
    """

    time: float
    contact: str
    force: float


def find_impacts(time: FloatArray, forces: Mapping[str, FloatArray]) -> tuple[Impact, ...]:
    """Return the instants at which a contact force rises out of the air.

    A contact is in the air while its force stays below a twentieth of the largest median over
    loaded samples; it has hit the ground when it was in the air for 20 ms and then bears more
    than that median. Standing still from the first sample is no impact.

    Args:
        time: (N,) [s].
        forces: contact name -> (N, 3) [N].
    """
    impacts = []
    for name, force in forces.items():
        size = np.linalg.norm(force, axis=1)
        loaded = size[size > _QUIET * size.max()] if size.max() > 0.0 else size
        typical = float(np.median(loaded))
        if typical <= 0.0:
            continue
        free_since = time[0]
        free = size[0] < _QUIET * typical
        for row in range(1, len(time)):
            if size[row] < _QUIET * typical:
                free_since = free_since if free else time[row]
                free = True
            elif free:
                free = False
                if time[row] - free_since < 0.02:
                    continue
                soon = size[row : row + 1 + int(np.searchsorted(time[row:], time[row] + 0.02))]
                if soon.max() > typical:
                    impacts.append(Impact(float(time[row]), name, float(soon.max())))
    return tuple(sorted(impacts, key=lambda impact: impact.time))
