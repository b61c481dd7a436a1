"""The cost of the contact forces: towards a shared load, and towards what tasks ask of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wbc.arrays import IntArray
from wbc.control.contacts.contact_set import ContactSet
from wbc.control.efforts import ContactForceTask
from wbc.control.reference import Reference


class ContactForceCost:
    """Diagonal and gradient of the cost on the force variables of one set of contacts.

    Attributes:
        tracks: whether any active contact has a force task, so that the cost changes at all.
        diagonal: (k,) of the Hessian.
        pull: (k,), the gradient.
    """

    def __init__(
        self,
        contacts: ContactSet,
        tasks: Sequence[ContactForceTask],
        regularisation: float,
        weight: float,
        scale: float,
    ) -> None:
        """Write the cost without references.

        Args:
            contacts: the active contacts.
            tasks: costs on contact forces; those of inactive contacts stay idle.
            regularisation: weight of the force variables towards the shared load.
            weight: of the robot [N], the load that is shared.
            scale: [N] per unit of force variable.
        """
        self._tasks = _active_tasks(tasks, contacts)
        self._scale, self._regularisation = scale, regularisation
        self._shared = -regularisation * (contacts.load_share(weight) / scale)
        self.tracks = bool(self._tasks)
        self.diagonal = np.full(contacts.rows, regularisation)
        self.pull = self._shared.copy()

    def fill(self, references: Mapping[str, Reference]) -> None:
        """Write the cost; tasks without a reference ask nothing."""
        self.diagonal[:], self.pull[:] = self._regularisation, self._shared
        for task, rows, components in self._tasks:
            reference = references.get(task.name)
            if reference is None or reference.position is None:
                continue
            wanted = np.asarray(reference.position)
            weight = np.broadcast_to(task.weight, wanted.shape)[components]
            self.diagonal[rows] += self._scale**2 * weight
            self.pull[rows] -= self._scale * weight * wanted[components]


def _active_tasks(
    tasks: Sequence[ContactForceTask], contacts: ContactSet
) -> list[tuple[ContactForceTask, slice, IntArray]]:
    """Return the force tasks of active contacts with the rows and components they act on."""
    found = []
    for contact, rows in zip(contacts.contacts, contacts.slices, strict=True):
        found += [(t, rows, contact.components) for t in tasks if t.contact == contact.name]
    return found
