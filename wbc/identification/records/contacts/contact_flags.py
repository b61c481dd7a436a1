"""Which contacts touch while no sensor measures their force."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray
from wbc.dynamics import Workspace
from wbc.errors import IdentificationError
from wbc.measurement import Log
from wbc.robot import Robot

STANDS = 0.01  # [m] that a point may move while its robot stands; a foot that steps moves more


def active_contacts(
    robot: Robot, log: Log, grid: FloatArray, position: FloatArray
) -> dict[str, BoolArray]:
    """Return contact name -> (N,) whether it touches, of the contacts without a force sensor.

    From `<contact>.active`; where a log of a free base has neither forces nor flags, all contacts
    are active if none of them moves: the robot stands.

    Args:
        robot: with a free base, or else nothing is unknown.
        log: as recorded.
        grid: (N,) even time stamps.
        position: q (N, nq) at these.

    Raises:
        IdentificationError: neither forces nor flags, and a contact moves.
    """
    if not robot.floating_size or not robot.contacts:
        return {}  # a robot without contacts flies: its base needs no force
    names = [contact.name for contact in robot.contacts]
    flagged = [n for n in names if log.has(f"{n}.active") and n not in log.contacts]
    if flagged or any(name in log.contacts for name in names):
        return {name: _held(log, f"{name}.active", grid) for name in flagged}
    moves = moved(robot, position)
    if any(distance > STANDS for distance in moves.values()):
        farthest = max(moves, key=lambda name: moves[name])
        raise IdentificationError(
            f"{log.source.label}: '{robot.name}' has a free base, so its log needs the contact "
            f"forces, for example '<contact>.force.z', or '<contact>.active' (1 while it touches), "
            f"of: {', '.join(names)}. Without both it must stand on all of them, but "
            f"'{farthest}' moves by {moves[farthest]:.2g} m."
        )
    return {name: np.ones(len(grid), dtype=bool) for name in names}


def moved(robot: Robot, position: FloatArray) -> dict[str, float]:
    """Return how far [m] every contact point moves along q (N, nq), but for one row in fifty."""
    space = Workspace(robot)
    places = np.empty((len(position), len(robot.contacts), 3))
    for row, q in enumerate(position):
        pin.framesForwardKinematics(space.model, space.data, q)
        places[row] = [space.data.oMf[frame].translation for frame in space.frames]
    low, high = np.quantile(places, [0.01, 0.99], axis=0) if len(position) else np.zeros((2, 0, 3))
    distances = np.linalg.norm(high - low, axis=1)
    return {c.name: float(d) for c, d in zip(robot.contacts, distances, strict=True)}


def _held(log: Log, name: str, grid: FloatArray) -> BoolArray:
    """Return a flag on the grid: that of the last row at or before each time."""
    rows = np.searchsorted(log.time, grid + 1e-9, side="right") - 1
    return np.asarray(log.column(name)[np.clip(rows, 0, len(log) - 1)] > 0.5)
