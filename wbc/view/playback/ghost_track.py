"""A ghost brought to the frames of a playback."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import Robot
from wbc.view.playback.ghost import Ghost
from wbc.view.playback.track import joint_poses


@dataclass(frozen=True, eq=False)
class GhostTrack:
    """A second robot at the frames.

    Attributes:
        label: what the page calls it.
        poses: (F, joints, 7) as in `Track.poses`.
        residual: joint -> (F,) measured minus modelled torque, in noise floors.
    """

    label: str
    poses: FloatArray
    residual: Mapping[str, FloatArray]


def track_ghost(robot: Robot, ghost: Ghost, time: FloatArray) -> GhostTrack:
    """Return the ghost at frame times (F,) [s]; the nearest sample is shown."""
    later = np.clip(np.searchsorted(ghost.time, time), 1, len(ghost.time) - 1)
    rows = np.where(time - ghost.time[later - 1] < ghost.time[later] - time, later - 1, later)
    residual = {
        joint: np.interp(time, ghost.residual_time, values)
        for joint, values in ghost.residual.items()
    }
    return GhostTrack(ghost.label, joint_poses(robot, ghost.position[rows]), residual)
