"""Letting contacts take up and give off their load gradually while the robot moves."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import final

import numpy as np

from wbc.errors import ControlError, unknown_name


@final
class ContactRamp:
    """Greatest normal forces for `Controller.step` that follow a changing set of contacts.

    A contact that is wanted no longer loses its ceiling in a straight line and leaves the set when
    the ceiling reaches zero; one that is wanted again gets it back in the same way, and is free of
    any ceiling at the end. The user owns the schedule:

        ramp = ContactRamp(["left", "right"], load=weight, duration=0.2)
        ...
        command = controller.step(state, references, ramp.step({"left"}, dt))
    """

    def __init__(self, contacts: Sequence[str], load: float, duration: float) -> None:
        """Start with every contact active.

        Args:
            contacts: names of all contacts.
            load: normal force [N] from which and to which the ceilings go, for example the weight.
            duration: of a ramp [s].

        Raises:
            ControlError: no contact, or a load or duration that is not positive.
        """
        if not contacts or not load > 0.0 or not duration > 0.0:
            raise ControlError("a contact ramp needs contacts, a load > 0 N and a duration > 0 s.")
        self._load, self._rate = load, 1.0 / duration
        self._share = dict.fromkeys(contacts, 1.0)

    @property
    def settled(self) -> bool:
        """Whether no contact is on a ramp."""
        return all(share in (0.0, 1.0) for share in self._share.values())

    def step(self, wanted: Collection[str], dt: float) -> Mapping[str, float]:
        """Go on for `dt` [s]; return the ceiling [N] of every contact that may carry force.

        Raises:
            ControlError: a contact that there is not.
        """
        for name in wanted:
            if name not in self._share:
                raise ControlError(unknown_name("contact", name, self._share))
        ceilings = {}
        for name, share in self._share.items():
            change = dt * self._rate if name in wanted else -dt * self._rate
            share = min(max(share + change, 0.0), 1.0)
            self._share[name] = share
            if share > 0.0:
                ceilings[name] = np.inf if share == 1.0 else share * self._load
        return ceilings
