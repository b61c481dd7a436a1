"""The model beside the measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from wbc.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class GhostTrack:
    """A second robot at the frames of a playback.

    Attributes:
        label: what the page calls it.
        poses: (F, joints, 7) as in `Track.poses`.
        residual: joint -> (F,) measured minus modelled torque, in noise floors.
    """

    label: str
    poses: FloatArray
    residual: Mapping[str, FloatArray]
