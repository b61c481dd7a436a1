"""One tick: what it is given, and what it knows once that has passed all checks."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import inf
from typing import NamedTuple

from wbc.arrays import FloatArray
from wbc.control.contacts import BoundContact
from wbc.control.efforts import ContactForceTask
from wbc.control.program.level import Level
from wbc.control.reference import Reference
from wbc.control.safety.inputs import (
    Complaint,
    force_complaint,
    name_complaint,
    share_complaint,
    step_complaint,
)
from wbc.control.state import State
from wbc.control.torque.gears import GearState
from wbc.robot import Motion


class TickInputs(NamedTuple):
    """The arguments of `Controller.step`."""

    state: State
    references: Mapping[str, Reference]
    contacts: Mapping[str, float] | None
    weights: Mapping[str, float] | None
    activation: Mapping[str, float] | None
    dt: float


class ReadyTick(NamedTuple):
    """A tick that passed all checks, evaluated and ready to be solved."""

    motion: Motion
    references: Mapping[str, Reference]
    contacts: Mapping[str, float] | None
    dt: float
    levels: tuple[Level, ...]
    gears: GearState
    expected: FloatArray
    disturbance: FloatArray


class RefusedTick(NamedTuple):
    """A tick whose inputs did not pass them, although its state did."""

    motion: Motion
    complaint: Complaint


class InputCheck(NamedTuple):
    """What the inputs of a controller may name.

    Attributes:
        names: of everything that takes a reference.
        weighed: names of the tasks that have a weight to change.
        contacts: every contact, by name.
        force_tasks: the tasks on contact forces.
    """

    names: Collection[str]
    weighed: Collection[str]
    contacts: Mapping[str, BoundContact]
    force_tasks: tuple[ContactForceTask, ...]

    def complaint(self, given: TickInputs) -> Complaint | None:
        """Return what is wrong with the inputs besides the state, None if nothing is."""
        _, references, contacts, weights, activation, dt = given
        found = name_complaint(references, self.names, contacts, self.contacts)
        if found is None and weights is not None:
            found = share_complaint("weights", weights, self.weighed, inf)
        if found is None and activation is not None:
            found = share_complaint("activation", activation, self.weighed, 1.0)
        if found is None and self.force_tasks:
            found = force_complaint(self.force_tasks, self.contacts, references)
        return step_complaint(dt) if found is None else found
