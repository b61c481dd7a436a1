"""How many rows of some contacts are independent of one another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.contacts.contact import BoundContact
from wbc.control.kinematics import Kinematics
from wbc.robot import Robot

_POSES = 3
# A row that others decide keeps 1e-16 of its length, an independent one 1e-3 at a drawn pose.
_DEPENDENT = 1e-9


class ContactRanks:
    """Ranks of contact Jacobians at drawn poses: what the robot's structure allows.

    Several points of one rigid body repeat each other, as do the feet of a robot that has few
    joints between them.
    """

    def __init__(
        self, robot: Robot, kinematics: Kinematics, contacts: Mapping[str, BoundContact]
    ) -> None:
        """Evaluate all contacts at a few drawn poses."""
        generator, nv = np.random.default_rng(0), robot.model.nv
        self._rows: dict[str, list[FloatArray]] = {name: [] for name in contacts}
        for _ in range(_POSES):
            q = pin.integrate(robot.model, robot.neutral(), generator.uniform(-1.0, 1.0, nv))
            kinematics.update(q, np.zeros(nv))
            for name, contact in contacts.items():
                rows = np.zeros((contact.rows, nv))
                contact.fill(kinematics, rows, np.zeros(contact.rows))
                self._rows[name].append(rows)

    def rank(self, names: Sequence[str]) -> int:
        """Return the greatest number of independent rows of some contacts."""
        if not names:
            return 0
        found = []
        for pose in range(_POSES):
            rows = np.vstack([self._rows[name][pose] for name in names])
            lengths = np.linalg.norm(rows, axis=1)
            rows = rows[lengths > 0.0] / lengths[lengths > 0.0, None]
            found.append(int(np.linalg.matrix_rank(rows, tol=_DEPENDENT * np.sqrt(rows.size))))
        return max(found)
