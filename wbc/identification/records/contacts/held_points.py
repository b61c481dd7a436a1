"""How far contact points move while their contacts hold, as the encoders tell it.

A contact that holds does not slip: the null space of the contacts rests on that, and encoders with
a wrong zero contradict it. No torque takes part in this, so it tells a wrong zero from everything
that only asks for torque.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray
from wbc.dynamics import Workspace, contact_jacobians
from wbc.robot import Robot


def settled(touches: BoolArray, edge: int) -> BoolArray:
    """Return the rows (N,) at which a contact has touched, and goes on, for `edge` rows.

    Filters carry what moves before and after into the contact.
    """
    padded = np.concatenate([np.full(edge, True), touches, np.full(edge, True)])
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * edge + 1)
    return np.asarray(windows.all(axis=1))


def strays(robot: Robot, position: FloatArray, holds: Mapping[str, BoolArray]) -> FloatArray:
    """Return (N, 3 c) how far [m] each point is from its mean while its contact holds.

    Zero where it does not hold. Every time that a contact holds has a mean of its own.

    Args:
        robot: whose contacts these are.
        position: q (N, nq).
        holds: contact name -> (N,).
    """
    space = Workspace(robot)
    names = [contact.name for contact in robot.contacts]
    frames = [space.frames[names.index(name)] for name in holds]
    points = np.empty((len(position), len(frames), 3))
    for row, q in enumerate(position):
        pin.framesForwardKinematics(space.model, space.data, q)
        points[row] = [space.data.oMf[frame].translation for frame in frames]
    for column, rows in enumerate(holds.values()):
        points[~rows, column] = 0.0
        for time in _times(rows):
            points[time, column] -= points[time, column].mean(axis=0)
    return points.reshape(len(position), -1)


def stray_noise(
    robot: Robot, position: FloatArray, holds: Mapping[str, BoolArray], variance: FloatArray
) -> FloatArray:
    """Return (N, 3 c) the variance [m^2] of strays that the encoders' noise makes.

    Args:
        robot: whose contacts these are.
        position: q (N, nq).
        holds: contact name -> (N,).
        variance: (nv,) of the smoothed positions.
    """
    parts = [
        (contact_jacobians(robot, position, name) ** 2 @ variance) * rows[:, None]
        for name, rows in holds.items()
    ]
    return np.concatenate(parts, axis=1)


def _times(rows: BoolArray) -> list[slice]:
    """Return the stretches of rows (N,) that are true."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(ends[::2], ends[1::2], strict=True)]
