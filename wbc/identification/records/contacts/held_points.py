"""How far contact points move while their contacts hold, as the encoders tell it.

A contact that holds does not slip: the null space of the contacts rests on that, and encoders with
a wrong zero contradict it. No torque takes part in this, so it tells a wrong zero from everything
that only asks for torque.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

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
    numbers = [names.index(name) for name in holds]
    frames = [space.frames[number] for number in numbers]
    points = np.empty((len(position), len(frames), 3))
    turned = np.empty((len(position), len(frames), 3, 3))
    for row, q in enumerate(position):
        pin.framesForwardKinematics(space.model, space.data, q)
        for column, frame in enumerate(frames):
            place = space.data.oMf[frame]
            points[row, column], turned[row, column] = place.translation, place.rotation
    points -= rolled(turned, [robot.contacts[n].radius for n in numbers], _up(robot))
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


def rolled(turned: FloatArray, radii: Sequence[float], up: FloatArray) -> FloatArray:
    """Return (N, c, 3) how far [m] balls at contact points have rolled since the first row.

    Args:
        turned: (N, c, 3, 3) orientations.
        radii: (c,) of the balls [m].
        up: (3,) normal of the ground.
    """
    way = np.zeros(turned.shape[:3])
    for column, radius in enumerate(radii):
        if radius > 0.0:
            frames = turned[:, column]
            turns = [pin.log3(b @ a.T) for a, b in itertools.pairwise(frames)]
            way[1:, column] = np.cumsum(np.cross(turns, radius * up), axis=0)
    return way


def _up(robot: Robot) -> FloatArray:
    """Return (3,) the normal of level ground."""
    gravity = np.asarray(robot.model.gravity.linear)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])


def _times(rows: BoolArray) -> list[slice]:
    """Return the stretches of rows (N,) that are true."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(ends[::2], ends[1::2], strict=True)]
