"""Taking back the drift of contacts from where they first stood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.contacts.contact import BoundContact
from wbc.control.kinematics import RowKind, StateRows


class ContactPull:
    """Adds -stiffness d to what contacts want, d being the drift in their rows.

    Attributes:
        names: of the contacts that have a stiffness; the others drift as the ground lets them.
    """

    def __init__(
        self,
        contacts: Sequence[BoundContact],
        slices: Sequence[slice],
        table: Sequence[tuple[StateRows, int]],
    ) -> None:
        """Sort out who pulls.

        Args:
            contacts: of a set, with their rows `slices`.
            slices: rows of every contact.
            table: rows and first row of those that a `FrameTable` evaluates, in its order.
        """
        places = {first: i for i, (_, first) in enumerate(table)}
        self._pulling = [
            (contact.name, contact.contact.stiffness, rows, places[rows.start], table)
            for contact, rows in zip(contacts, slices, strict=True)
            if contact.contact.stiffness > 0.0 and rows.start in places
        ]
        self.names = tuple(entry[0] for entry in self._pulling)

    def add(
        self, places: FloatArray, anchors: Mapping[str, FloatArray], target: FloatArray
    ) -> None:
        """Add what takes the drift from the anchors back to `target` (k,)."""
        for name, stiffness, rows, number, table in self._pulling:
            anchor = anchors.get(name)
            if anchor is not None:
                target[rows] -= stiffness * _drift(table[number][0], anchor, places[number])

    def kept(self, places: FloatArray, anchors: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return the anchors of the contacts: their own of before, or where they are now."""
        return {
            name: anchors[name] if name in anchors else places[number].copy()
            for name, _, _, number, _ in self._pulling
        }


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
