"""One program and one solver per set of active contacts, made when first needed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wbc.arrays import BoolArray
from wbc.control.contact_set import ContactSet
from wbc.control.contacts import BoundContact
from wbc.control.direction_search import DirectionSearch
from wbc.control.limits import JointLimit
from wbc.control.plant import Plant
from wbc.control.program import ContactForceProgram
from wbc.control.settings import ControllerSettings


class ProgramLibrary:
    """Keeps the programs of the contact sets met so far, each with its own warm start."""

    def __init__(
        self,
        plant: Plant,
        contacts: Mapping[str, BoundContact],
        limited: BoolArray,
        joint_limit: JointLimit | None,
        settings: ControllerSettings,
    ) -> None:
        """Remember what programs are made of."""
        self._plant, self._contacts = plant, contacts
        self._limited, self._joint_limit, self._settings = limited, joint_limit, settings
        self._all = tuple(contacts)
        self._searches: dict[tuple[str, ...], DirectionSearch] = {}

    def search(self, active: Mapping[str, float] | None) -> DirectionSearch:
        """Return the search for the contacts that may carry force, all when None."""
        names = self._all
        if active is not None:
            names = tuple(name for name in names if active.get(name, 0.0) > 0.0)
        search = self._searches.get(names)
        if search is None:
            search = self._made(names)
            self._searches[names] = search
        return search

    def _made(self, names: tuple[str, ...]) -> DirectionSearch:
        settings = self._settings
        contacts = ContactSet([self._contacts[name] for name in names], self._plant.robot.model.nv)
        program = ContactForceProgram(
            self._plant,
            contacts,
            np.asarray(self._limited),
            self._joint_limit,
            (settings.acceleration_weight, settings.force_weight),
        )
        return DirectionSearch(
            program,
            settings.solver,
            settings.tolerance,
            settings.max_iterations,
            settings.max_rounds,
        )
