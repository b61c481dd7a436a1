"""Where the inequalities of the contact-force program stand, and what they are called."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.contacts.contact_set import ContactSet
from wbc.control.limits import JointLimit
from wbc.control.solvers import INFINITE


class InequalityRows:
    """Rows lower <= C x <= upper: rotor torques, cones, normal forces, joints, distances.

    Only the torque and distance rows change with the state; the others are written here once, but
    for the bounds of normal forces and joints.

    Attributes:
        C: (n_in, n).
        lower, upper: (n_in,).
        torque, cone, normal, joint, distance: slices of the rows of each kind.
        of_torque: C, lower and upper of the torque rows, views.
        slack: how far every bound lies beyond what it stands for.
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
            slack: how far every bound lies beyond what it stands for.
            distances: names of the pairs of solids that keep apart.
        """
        self._force_scale, self.slack = force_scale, slack
        faces, normals = len(contacts.cone), len(contacts.contacts)
        joints = () if joint_limit is None else joint_limit.joints
        ends = np.cumsum([0, len(gears), faces, normals, len(joints), len(distances)]).tolist()
        self.torque, self.cone, self.normal, self.joint, self.distance = (
            slice(a, b) for a, b in pairwise(ends)
        )
        self._nv = nv
        self.C = np.zeros((ends[-1], nv + contacts.rows))
        self.lower, self.upper = np.full(ends[-1], -INFINITE), np.full(ends[-1], INFINITE)
        limited = self.torque
        self.of_torque = self.C[limited], self.lower[limited], self.upper[limited]
        self.C[self.cone, nv:] = contacts.cone
        self.upper[self.cone] = slack
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
        scale, slack = self._force_scale, self.slack
        self.lower[self.normal] = np.minimum(least, greatest) / scale - slack
        self.upper[self.normal] = np.minimum(greatest / scale, INFINITE) + slack

    def write_joints(self, least: FloatArray, greatest: FloatArray) -> None:
        """Write the bounds (j,) of the joints' accelerations."""
        slack = self.slack
        self.lower[self.joint], self.upper[self.joint] = least - slack, greatest + slack

    def write_distances(self, rows: FloatArray, least: FloatArray) -> None:
        """Write rows (p, nv) and the bounds (p,) of the accelerations between solids."""
        self.C[self.distance, : self._nv] = rows
        np.subtract(least, self.slack, out=self.lower[self.distance])

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
