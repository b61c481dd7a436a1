"""The contacts that are active in one tick, with their rows in one block."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray
from wbc.control.contacts.contact import BoundContact
from wbc.control.contacts.contact_pull import ContactPull
from wbc.control.kinematics import FrameTable, Kinematics
from wbc.control.program.stacking import REST, rest
from wbc.fixed_arrays import FixedArrays


class ContactSet:
    """Stacked rows of some contacts.

    Attributes:
        contacts: the contacts, in order.
        rows: total number of rows k, which is also that of force components.
        rank: how many of them are independent.
        jacobian: J (k, nv).
        target: (k,) what J qdd must be: -drift - damping J v.
        cone: (p, k) rows <= 0 on the forces in newtons.
        cone_labels: (p,) names for messages.
        normals: (c, k), normal force of each contact.
    """

    def __init__(
        self, contacts: Sequence[BoundContact], model: pin.Model, rank: int | None = None
    ) -> None:
        """Lay out the rows.

        Args:
            contacts: the contacts.
            model: of the `Kinematics` that is read.
            rank: how many of the rows are independent; all when left out.
        """
        nv = model.nv
        self.contacts = tuple(contacts)
        self.slices: list[slice] = []
        start = 0
        for contact in self.contacts:
            self.slices.append(slice(start, start + contact.rows))
            start += contact.rows
        self.rows = start
        self.rank = start if rank is None else rank
        self._wrenches = [
            (contact.name, _own_wrench(contact), rows)
            for contact, rows in zip(self.contacts, self.slices, strict=True)
        ]
        self.jacobian = np.zeros((start, nv))
        self.target = np.zeros(start)
        self._drift = np.zeros(start)
        self._placed = False
        self._damping = np.zeros(start)
        self._foreign = [i for i, c in enumerate(self.contacts) if c.state_rows is None]
        known = [
            (contact.state_rows, rows.start)
            for contact, rows in zip(self.contacts, self.slices, strict=True)
        ]
        wanted = [(rows, first) for rows, first in known if rows is not None]
        self._table = FrameTable(model, [w[0] for w in wanted], [w[1] for w in wanted])
        self._pull = ContactPull(self.contacts, self.slices, wanted)
        faces = sum(len(contact.cone.matrix) for contact in self.contacts)
        self.cone = np.zeros((faces, start))
        self.normals = np.zeros((len(self.contacts), start))
        labels: list[str] = []
        for i, (contact, rows) in enumerate(zip(self.contacts, self.slices, strict=True)):
            first = len(labels)
            labels.extend(f"{contact.name}: {label}" for label in contact.cone.labels)
            self.cone[first : len(labels), rows] = contact.cone.matrix
            self.normals[i, rows] = contact.cone.normal
            self._damping[rows] = contact.contact.damping
        self.cone_labels = tuple(labels)
        self._lay_out()
        self.normal_minimum = np.array([c.contact.normal_minimum for c in self.contacts])
        self.normal_maximum = np.array([c.contact.normal_maximum for c in self.contacts])

    def place(self, jacobian: FloatArray, target: FloatArray) -> bool:
        """Keep the rows in the memory of a program from now on; return whether that is granted.

        The first program that asks gets them, the programs of further levels must copy. Rows
        that repeat each other are not granted: a program holds a basis of them.
        """
        if self._placed or self.rank < self.rows:
            return False
        self.jacobian, self.target = jacobian, target
        self._placed = True
        self._lay_out()
        return True

    def _lay_out(self) -> None:
        self._fixed = FixedArrays(REST, (self.jacobian, self._damping, self._drift, self.target))
        self._memory = self._fixed.table

    def fill(self, kinematics: Kinematics, anchors: Mapping[str, FloatArray] | None = None) -> None:
        """Evaluate the rows at the present state.

        Args:
            kinematics: of the state.
            anchors: placement (12,) by name, of contacts whose drift is to be taken back.
        """
        jacobian, drift = self.jacobian, self._drift
        for i in self._foreign:
            rows = self.slices[i]
            self.contacts[i].fill(kinematics, jacobian[rows], drift[rows])
        self._table.fill(kinematics, jacobian, drift)
        rest(self._memory, kinematics.velocity)
        if anchors and self._pull.names:
            self._pull.add(self._table.places, anchors, self.target)

    @property
    def is_known(self) -> bool:
        """Whether all rows and what they want follow from the state alone."""
        return not self._foreign and not self._pull.names

    def memory(self, kinematics: Kinematics) -> tuple[IntArray, IntArray]:
        """Return the memory of `fill_state_rows` and `rest`, which `fill` calls."""
        return self._table.memory(kinematics, self.jacobian, self._drift), self._memory

    def anchored(self, anchors: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return where the contacts that take drift back stood in the first tick, by name.

        Args:
            anchors: those of the last tick; a contact that is not active loses its own.
        """
        return self._pull.kept(self._table.places, anchors) if self._pull.names else {}

    def wrenches(self, force: FloatArray) -> dict[str, FloatArray]:
        """Return the force of every contact as users see it, of all components (k,) [N, N m]."""
        return {
            name: force[rows] if wrench is None else wrench(force[rows])
            for name, wrench, rows in self._wrenches
        }

    def load_share(self, weight: float) -> FloatArray:
        """Return forces (k,) [N] that share `weight` [N] equally among the normals."""
        if not self.contacts:
            return np.zeros(0)
        return np.asarray(self.normals.sum(axis=0) * (weight / len(self.contacts)))


def _own_wrench(contact: BoundContact) -> Callable[[FloatArray], FloatArray] | None:
    """Return what turns a contact's force into what users see, None where it is the same."""
    probe = np.zeros(contact.rows)
    return None if contact.wrench(probe) is probe else contact.wrench
