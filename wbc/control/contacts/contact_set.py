"""The contacts that are active in one tick, with their rows in one block."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.contacts import BoundContact
from wbc.control.kinematics import Kinematics
from wbc.control.program.stacking import place_rest


class ContactSet:
    """Stacked rows of some contacts.

    Attributes:
        contacts: the contacts, in order.
        rows: total number of rows k, which is also that of force components.
        jacobian: J (k, nv).
        target: (k,) what J qdd must be: -drift - damping J v.
        cone: (p, k) rows <= 0 on the forces in newtons.
        cone_labels: (p,) names for messages.
        normals: (c, k), normal force of each contact.
    """

    def __init__(self, contacts: Sequence[BoundContact], nv: int) -> None:
        """Lay out the rows."""
        self.contacts = tuple(contacts)
        self.slices: list[slice] = []
        start = 0
        for contact in self.contacts:
            self.slices.append(slice(start, start + contact.rows))
            start += contact.rows
        self.rows = start
        self._wrenches = [
            (contact.name, contact.wrench, rows)
            for contact, rows in zip(self.contacts, self.slices, strict=True)
        ]
        self.jacobian = np.zeros((start, nv))
        self.target = np.zeros(start)
        self._drift = np.zeros(start)
        self._placed = False
        self._damping = np.zeros(start)
        self._places = [(self.jacobian[rows], self._drift[rows]) for rows in self.slices]
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
        self.normal_minimum = np.array([c.contact.normal_minimum for c in self.contacts])
        self.normal_maximum = np.array([c.contact.normal_maximum for c in self.contacts])

    def place(self, jacobian: FloatArray, target: FloatArray) -> bool:
        """Keep the rows in the memory of a program from now on; return whether that is granted.

        The first program that asks gets them, the programs of further levels must copy.
        """
        if self._placed:
            return False
        self.jacobian, self.target = jacobian, target
        self._places = [(jacobian[rows], self._drift[rows]) for rows in self.slices]
        self._placed = True
        return True

    def fill(self, kinematics: Kinematics) -> None:
        """Evaluate the rows at the present state."""
        for contact, (jacobian, drift) in zip(self.contacts, self._places, strict=True):
            contact.fill(kinematics, jacobian, drift)
        place_rest(self.jacobian, kinematics.velocity, self._damping, self._drift, self.target)

    def wrenches(self, force: FloatArray) -> dict[str, FloatArray]:
        """Return the force of every contact as users see it, of all components (k,) [N, N m]."""
        return {name: wrench(force[rows]) for name, wrench, rows in self._wrenches}

    def load_share(self, weight: float) -> FloatArray:
        """Return forces (k,) [N] that share `weight` [N] equally among the normals."""
        if not self.contacts:
            return np.zeros(0)
        return np.asarray(self.normals.sum(axis=0) * (weight / len(self.contacts)))
