"""The contacts that are active in one tick, with their rows in one block."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.kinematics import FrameTable, Kinematics, StateRows
from wbc.control.rows.contacts import BoundContact
from wbc.control.tick import CONTACTS, rest
from wbc.control.tree import RowKind
from wbc.robot import Robot

_POSES = 3
# A row that others decide keeps 1e-16 of its length, an independent one 1e-3 at a drawn pose.
_DEPENDENT = 1e-9


class ContactSet:
    """Stacked rows of some contacts.

    Attributes:
        contacts: the contacts, in order.
        rows: total number of rows k, which is also that of force components.
        rank: how many of them are independent.
        asked: whether a tick has to ask for rows or what they want: these do not follow from the
            state alone, or some of them repeat others.
        pulls: name, stiffness, rows, number and rows in the table of contacts whose drift is taken
            back.
        memory: the CONTACTS, J (k, nv) and what J qdd must be (k,) among them.
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
        damping = np.zeros(start)
        self._foreign = [i for i, c in enumerate(self.contacts) if c.state_rows is None]
        states = [
            (contact.state_rows, rows.start)
            for contact, rows in zip(self.contacts, self.slices, strict=True)
        ]
        wanted = [(rows, first) for rows, first in states if rows is not None]
        chosen, firsts = [w[0] for w in wanted], [w[1] for w in wanted]
        table = FrameTable(model, chosen, firsts, np.zeros((start, nv)), np.zeros(start))
        corners = [
            np.column_stack([np.full(len(own), number), own])
            for number, own in enumerate(c.corners for c in self.contacts if c.state_rows)
        ]
        level = all(len(contact.corners) for contact in self.contacts)
        self.memory: Any = CONTACTS.of(
            rows=table.rows,
            damping=damping,
            target=np.zeros(start),
            corners=np.vstack([np.zeros((0, 4)), *corners]) if level else np.zeros((0, 4)),
        )
        self.pulls = [
            (contact.name, contact.contact.stiffness, rows, firsts.index(rows.start), own)
            for contact, rows, (own, _) in zip(self.contacts, self.slices, states, strict=True)
            if contact.contact.stiffness > 0.0 and own is not None
        ]
        self.asked = bool(self._foreign or self.pulls or self.rank < self.rows)
        faces = sum(len(contact.cone.matrix) for contact in self.contacts)
        self.cone = np.zeros((faces, start))
        self.normals = np.zeros((len(self.contacts), start))
        labels: list[str] = []
        for i, (contact, rows) in enumerate(zip(self.contacts, self.slices, strict=True)):
            first = len(labels)
            labels.extend(f"{contact.name}: {label}" for label in contact.cone.labels)
            self.cone[first : len(labels), rows] = contact.cone.matrix
            self.normals[i, rows] = contact.cone.normal
            damping[rows] = contact.contact.damping
        self.cone_labels = tuple(labels)
        self.normal_minimum = np.array([c.contact.normal_minimum for c in self.contacts])
        self.normal_maximum = np.array([c.contact.normal_maximum for c in self.contacts])

    def fill(self, kinematics: Kinematics, anchors: Mapping[str, FloatArray] | None = None) -> None:
        """Evaluate the rows at the present state, and what they are to be.

        Args:
            kinematics: of the state.
            anchors: placement (12,) by name, of contacts whose drift is to be taken back.
        """
        rows = self.memory.rows
        for i in self._foreign:
            own = self.slices[i]
            self.contacts[i].fill(kinematics, rows.jacobian[own], rows.drift[own])
        rest(kinematics.tree, self.memory, kinematics.velocity, kinematics.mass)
        if anchors:
            for name, stiffness, own, number, known in self.pulls:
                if name in anchors:
                    drift = _drift(known, anchors[name], rows.places[number])
                    self.memory.target[own] -= stiffness * drift

    def anchored(self, anchors: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return where the contacts that take drift back stood in the first tick, by name.

        Args:
            anchors: those of the last tick; a contact that is not active loses its own.
        """
        places = self.memory.rows.places
        return {
            name: anchors[name] if name in anchors else places[number].copy()
            for name, _, _, number, _ in self.pulls
        }

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


def _drift(rows: StateRows, anchor: FloatArray, place: FloatArray) -> FloatArray:
    """Return how far a placement (12,) is from its anchor (12,), in the contact's rows."""
    moved = place[9:] - anchor[9:]
    if rows.kind is RowKind.OWN:
        turn, before = place[:9].reshape(3, 3), anchor[:9].reshape(3, 3)  # transposed: by columns
        return np.concatenate([turn @ moved, pin.log3(before @ turn.T)])
    arm = np.array(rows.arm)
    if arm.any():
        moved = arm * (arm @ moved) / (arm @ arm)
    return np.asarray(moved[rows.rows])


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
