"""Where the inequalities of the contact-force program stand, and what they are called."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import Dense, Nothing, Number, OutRow, Places, Row, compiled
from wbc.control.contacts.contact_set import ContactSet
from wbc.control.limits import JointLimit
from wbc.control.solvers import INFINITE


@compiled(Nothing, Dense, Row, Row, Row, Number, Places, OutRow, OutRow)
def place_passing(
    C: FloatArray,
    low: FloatArray,
    high: FloatArray,
    x: FloatArray,
    slack: float,
    decided: IntArray,
    lower: FloatArray,
    upper: FloatArray,
) -> None:
    """Write bounds low <= C x <= high (r,) that let x (n,) pass where it breaks them by `slack`.

    Args:
        C, low, high, x, slack: rows (r, n), their bounds, the point, how far a bound may move.
        decided: (r,) 1 for rows that are equalities and need no bounds.
        lower, upper: results (r,), which may be `low` and `high`.
    """
    for i in range(len(low)):
        if decided[i] != 0:
            lower[i], upper[i] = -INFINITE, INFINITE
            continue
        value = 0.0
        for j in range(len(x)):
            value += C[i, j] * x[j]
        upper[i] = high[i] + min(max(value - high[i], 0.0), slack)
        lower[i] = low[i] - min(max(low[i] - value, 0.0), slack)


class InequalityRows:
    """Rows lower <= C x <= upper: rotor torques, cones, normal forces, joints, distances.

    Only the torque and distance rows change with the state; the others are written here once, but
    for the bounds of normal forces and joints. At a lower level `let_pass` moves bounds to where
    the level above is, which keeps them up to the tolerance: then its solution is one of the lower
    level, and no gap of the tolerance's size parts bounds that meet.

    Attributes:
        C: (n_in, n).
        lower, upper: (n_in,).
        size: how many rows there are, n_in.
        torque, cone, normal, joint, distance: slices of the rows of each kind.
        stated: (n_in,) each, lower and upper as they stand for something.
        of_torque: C and the stated bounds of the torque rows, views.
        slack: how far a bound may lie beyond what it stands for.
        decided: (n_in,) 1 for rows that `let_pass` frees from bounds.
        labels: (n_in,) what every row is called in messages.
    """

    def __init__(
        self,
        gears: list[str],
        contacts: ContactSet,
        joint_limit: JointLimit | None,
        nv: int,
        force_scale: float,
        slack: float,
        distances: Sequence[str] = (),
    ) -> None:
        """Lay the rows out.

        Args:
            gears: joints of the gears that have a torque limit.
            contacts: the active contacts.
            joint_limit: limits of joints, or None.
            nv: number of accelerations, which come before the forces in x.
            force_scale: [N] per unit of force variable.
            slack: how far a bound may lie beyond what it stands for.
            distances: names of the pairs of solids that keep apart.
        """
        self._force_scale, self.slack = force_scale, slack
        faces, normals = len(contacts.cone), len(contacts.contacts)
        joints = () if joint_limit is None else joint_limit.joints
        ends = np.cumsum([0, len(gears), faces, normals, len(joints), len(distances)]).tolist()
        self.torque, self.cone, self.normal, self.joint, self.distance = (
            slice(a, b) for a, b in pairwise(ends)
        )
        self._nv, self.size = nv, ends[-1]
        self.C = np.zeros((ends[-1], nv + contacts.rows))
        self.lower, self.upper = np.full(ends[-1], -INFINITE), np.full(ends[-1], INFINITE)
        self.stated = self.lower, self.upper
        if slack > 0.0:
            self.stated = self.lower.copy(), self.upper.copy()
        self.decided = np.zeros(ends[-1], dtype=np.int_)
        low, high = self.stated
        limited = self.torque
        self.of_torque = self.C[limited], low[limited], high[limited]
        self.C[self.cone, nv:] = contacts.cone
        high[self.cone] = 0.0
        self.C[self.normal, nv:] = contacts.normals
        if joint_limit is not None:
            self.C[np.arange(self.joint.start, self.joint.stop), joint_limit.rows] = 1.0
        self.labels = tuple(
            [f"rotor torque limit of '{joint}'" for joint in gears]
            + [f"contact {label}" for label in contacts.cone_labels]
            + [f"contact {contact.name}: normal force" for contact in contacts.contacts]
            + [f"joint limit of '{joint}'" for joint in joints]
            + list(distances)
        )

    def write_normals(self, least: FloatArray, greatest: FloatArray) -> None:
        """Write the bounds (c,) [N] of the normal forces; a low ceiling lowers the floor."""
        (low, high), scale = self.stated, self._force_scale
        low[self.normal] = np.minimum(least, greatest) / scale
        high[self.normal] = np.minimum(greatest / scale, INFINITE)

    def write_joints(self, least: FloatArray, greatest: FloatArray) -> None:
        """Write the bounds (j,) of the joints' accelerations."""
        low, high = self.stated
        low[self.joint], high[self.joint] = least, greatest

    def write_distances(self, rows: FloatArray, least: FloatArray) -> None:
        """Write rows (p, nv) and the bounds (p,) of the accelerations between solids."""
        self.C[self.distance, : self._nv] = rows
        self.stated[0][self.distance] = least

    def let_pass(self, x: FloatArray, chosen: slice) -> None:
        """Move the bounds of some rows to where x (n,) is beyond them, by `slack` at most."""
        (low, high), slack = self.stated, self.slack
        place_passing(
            *(self.C[chosen], low[chosen], high[chosen], x, slack, self.decided[chosen]),
            *(self.lower[chosen], self.upper[chosen]),
        )

    def decide(self, places: IntArray) -> None:
        """Take some rows (c,) as equalities, which bounds need not keep."""
        self.decided[:] = 0
        self.decided[places] = 1

    def scale_and_unit(self, row: int) -> tuple[float, str]:
        """Return what a violation of the row is multiplied with for its unit, and the unit."""
        if row < self.torque.stop:
            return 1.0, "N m at the motor output"
        if row < self.normal.stop:
            turns = row < self.cone.stop and any(
                word in self.labels[row] for word in ("pressure", "yaw")
            )
            return self._force_scale, "N m" if turns else "N"
        return 1.0, "rad/s^2" if row < self.joint.stop else "m/s^2"
