"""One program and one solver per set of active contacts, made when first needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from wbc.arrays import BoolArray
from wbc.control.contact_set import ContactSet
from wbc.control.contacts import BoundContact
from wbc.control.direction_search import DirectionSearch
from wbc.control.efforts import ContactForceTask, Effort
from wbc.control.limits import JointLimit
from wbc.control.plant import Plant
from wbc.control.program import ContactForceProgram
from wbc.control.settings import ControllerSettings


@dataclass(frozen=True, eq=False)
class Recipe:
    """What the programs of a controller are made of.

    Attributes:
        plant: the dynamics.
        contacts: every contact there may be, by name.
        limited: (m,) bool, gears that have a torque limit.
        joint_limit: limits of joints, or None.
        settings: of the controller.
        efforts: costs on torques, which the least important level bears.
        force_tasks: costs on contact forces, likewise.
        locked: rows that the level above hands down; None where there is one level only.
    """

    plant: Plant
    contacts: Mapping[str, BoundContact]
    limited: BoolArray
    joint_limit: JointLimit | None
    settings: ControllerSettings
    efforts: Sequence[Effort]
    force_tasks: Sequence[ContactForceTask]
    locked: int | None


@dataclass(frozen=True, eq=False, slots=True)
class Levels:
    """The searches of one set of contacts.

    Attributes:
        upper: of the more important tasks.
        lower: of the others, None where there is one level only.
    """

    upper: DirectionSearch
    lower: DirectionSearch | None


class ProgramLibrary:
    """Keeps the programs of the contact sets met so far, each with its own warm start."""

    def __init__(self, recipe: Recipe) -> None:
        """Remember what programs are made of."""
        self._recipe = recipe
        self._all = tuple(recipe.contacts)
        self._made: dict[tuple[str, ...], Levels] = {}

    def levels(self, active: Mapping[str, float] | None) -> Levels:
        """Return the searches for the contacts that may carry force, all when None."""
        names = self._all
        if active is not None:
            names = tuple(name for name in names if active.get(name, 0.0) > 0.0)
        levels = self._made.get(names)
        if levels is None:
            recipe = self._recipe
            nv = recipe.plant.robot.model.nv
            contacts = ContactSet([recipe.contacts[name] for name in names], nv)
            last = self._search(contacts, True, recipe.locked or 0)
            if recipe.locked is None:
                levels = Levels(last, None)
            else:
                levels = Levels(self._search(contacts, False, 0), last)
            self._made[names] = levels
        return levels

    def _search(self, contacts: ContactSet, last: bool, locked: int) -> DirectionSearch:
        recipe = self._recipe
        settings = recipe.settings
        program = ContactForceProgram(
            recipe.plant,
            contacts,
            recipe.limited,
            recipe.joint_limit,
            (settings.acceleration_weight, settings.force_weight),
            recipe.efforts if last else (),
            recipe.force_tasks if last else (),
            locked,
        )
        return DirectionSearch(
            program,
            settings.solver,
            settings.tolerance,
            settings.max_iterations,
            settings.max_rounds,
        )
