"""Contact forces that no sensor measured: eliminated from the rows that a model is judged by.

A force f at the active contacts adds J' f to every row of the equation of motion. The rows of the
undriven base hold no motor, so they tell f as far as J_u' does:

    f = pinv(J_u') w + Z z,     w the wrench that the base lacks,   J_u' Z = 0.

What is left of w lies in the null space of the contacts. Internal forces Z z move no base, so only
motors feel them: z is what leaves least at the motors' outputs, and the rest is judged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.ndimage import minimum_filter1d
from scipy.spatial.transform import Rotation

from wbc.arrays import BoolArray, FloatArray
from wbc.dynamics import Workspace
from wbc.dynamics.batch import contact_jacobians, level_normal
from wbc.errors import IdentificationError
from wbc.measurement import Log
from wbc.measurement.checks import true_runs
from wbc.robot import Robot

_STANDS = 0.01  # [m] that a point may move while its robot stands; a foot that steps moves more
_RANK = 1e-3  # of the largest singular value: directions below it are not told by the base


@dataclass(frozen=True, eq=False)
class ContactBalance:
    """The active contacts of one log without force sensors, k force components together.

    Attributes:
        push: J' (N, nv, k), zero while a contact is not active.
        from_base: (N, k, b) forces per wrench that the base lacks.
        inner: (N, k, m) internal forces per torque left at the motors' outputs; None where there
            are none, or none that a motor feels.
        unseen: (N, m, m) share of the torque at the motors' outputs that internal forces hide;
            None with `inner`.
        seen_share: (m + b,) mean share of every row that no contact force can be.
    """

    push: FloatArray
    from_base: FloatArray
    inner: FloatArray | None
    unseen: FloatArray | None
    seen_share: FloatArray

    @classmethod
    def of(
        cls, robot: Robot, position: FloatArray, active: Mapping[str, BoolArray]
    ) -> ContactBalance:
        """Return the balance along positions q (N, nq).

        Args:
            robot: whose contacts these are.
            position: q (N, nq).
            active: contact name -> (N,) whether it touches.
        """
        parts = [
            contact_jacobians(robot, position, name).transpose(0, 2, 1) * touches[:, None, None]
            for name, touches in active.items()
        ]
        push = np.concatenate(parts, axis=2)
        lifts = push[:, robot.unactuated]
        from_base = np.asarray(np.linalg.pinv(lifts, rcond=_RANK))
        base = 1.0 - np.einsum("nbk,nkb->b", lifts, from_base) / len(position)
        gears = np.ones(robot.transmission.size)
        free = np.eye(push.shape[2]) - from_base @ lifts
        felt = robot.transmission.topology.T @ push[:, robot.actuated] @ free
        felt[np.abs(felt) < 1e-9 * np.max(np.abs(push), initial=0.0)] = 0.0
        inner, unseen = None, None
        if felt.any():
            back = np.linalg.pinv(felt, rcond=_RANK)
            inner, unseen = free @ back, felt @ back
            gears = gears - np.einsum("nii->i", unseen) / len(position)
        return cls(push, from_base, inner, unseen, np.concatenate([gears, base]))

    def carried(self, wrench: FloatArray) -> FloatArray:
        """Return J' f (N, nv) of the forces that carry what the base lacks, wrench (N, b)."""
        force = np.einsum("nkb,nb->nk", self.from_base, wrench)
        return np.asarray(np.einsum("nvk,nk->nv", self.push, force))

    def squeezed(self, output: FloatArray) -> FloatArray:
        """Return J' f (N, nv) of the internal forces behind torque (N, m) left at the outputs."""
        if self.inner is None:
            return np.zeros(self.push.shape[:2])
        force = np.einsum("nkm,nm->nk", self.inner, output)
        return np.asarray(np.einsum("nvk,nk->nv", self.push, force))

    def seen(self, output: FloatArray) -> FloatArray:
        """Return what of torque (N, m) at the motors' outputs no internal force can be."""
        if self.unseen is None:
            return output
        return np.asarray(output - np.einsum("nij,nj->ni", self.unseen, output))


def settled(touches: BoolArray, edge: int) -> BoolArray:
    """Return the rows (N,) at which a contact has touched, and goes on, for `edge` rows.

    Filters carry what moves before and after into the contact.
    """
    return np.asarray(minimum_filter1d(touches, 2 * edge + 1, mode="constant", cval=1))


def strays(robot: Robot, position: FloatArray, holds: Mapping[str, BoolArray]) -> FloatArray:
    """Return (N, 3 c) how far [m] each point is from its mean while its contact holds.

    Zero where it does not hold. Every time that a contact holds has a mean of its own.

    Args:
        robot: whose contacts these are.
        position: q (N, nq).
        holds: contact name -> (N,).
    """
    contacts = [robot.contact(name) for name in holds]
    numbers = [robot.contacts.index(contact) for contact in contacts]
    points, turned = (values[:, numbers] for values in _places(robot, position))
    points -= rolled(turned, [contact.radius for contact in contacts], level_normal(robot))
    for column, rows in enumerate(holds.values()):
        points[~rows, column] = 0.0
        for start, stop in zip(*true_runs(rows), strict=True):
            points[start:stop, column] -= points[start:stop, column].mean(axis=0)
    return points.reshape(len(position), -1)


def _places(robot: Robot, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (N, c, 3) the places [m] and (N, c, 3, 3) the orientations of all contact points."""
    space = Workspace(robot)
    points = np.empty((len(position), len(space.frames), 3))
    turned = np.empty((*points.shape, 3))
    for row, q in enumerate(position):
        pin.framesForwardKinematics(space.model, space.data, q)
        for column, frame in enumerate(space.frames):
            place = space.data.oMf[frame]
            points[row, column], turned[row, column] = place.translation, place.rotation
    return points, turned


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
    if not any(radii):
        return np.zeros(turned.shape[:3])
    turns = turned[1:] @ np.swapaxes(turned[:-1], -1, -2)
    angles = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_rotvec().reshape(turns.shape[:3])
    steps = np.cross(angles, up) * np.asarray(radii)[:, None]
    return np.pad(np.cumsum(steps, axis=0), ((1, 0), (0, 0), (0, 0)))


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
        # A flag holds until the next row.
        rows = np.searchsorted(log.time, grid + 1e-9, side="right") - 1
        rows = np.clip(rows, 0, len(log) - 1)
        return {name: log.column(f"{name}.active")[rows] > 0.5 for name in flagged}
    moved = moving_contact(robot, position)
    if moved is not None:
        raise IdentificationError(
            f"{log.source.label}: neither forces nor flags of the contacts, and '{moved[0]}' moves "
            f"by {moved[1]:.2g} m."
        )
    return {name: np.ones(len(grid), dtype=bool) for name in names}


def moving_contact(robot: Robot, position: FloatArray) -> tuple[str, float] | None:
    """Return the contact point that moves most along q (N, nq) and how far [m], None if all stand.

    What one row in fifty shows does not count.
    """
    low, high = np.quantile(_places(robot, position)[0], [0.01, 0.99], axis=0)
    distances = np.linalg.norm(high - low, axis=1)
    most = int(np.argmax(distances))
    moves = distances[most] > _STANDS
    return (robot.contacts[most].name, float(distances[most])) if moves else None
