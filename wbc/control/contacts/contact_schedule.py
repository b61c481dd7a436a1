"""Which contacts stand when, over and over again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import final

from wbc.errors import ControlError, unknown_name


@final
@dataclass(frozen=True)
class ContactSchedule:
    """A gait: every contact stands for a part of a period, each with an offset of its own.

    The time is given, so that the user owns the clock:

        trot = ContactSchedule(0.5, {"FL": 0.0, "HR": 0.0, "FR": 0.5, "HL": 0.5}, duty=0.6)
        ceilings = ramp.step(trot.standing(time), dt)
        swing = trot.swing("FL", time)   # 0 to 1 in the air, None on the ground

    Attributes:
        period: [s].
        offsets: contact -> share of the period, 0 to 1, at which it begins to stand.
        duty: share of the period that every contact stands, in (0, 1].
    """

    period: float
    offsets: Mapping[str, float]
    duty: float = 0.5

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0.0 < self.period < inf or not 0.0 < self.duty <= 1.0 or not self.offsets:
            raise ControlError(
                "a contact schedule needs contacts, a period > 0 s and a duty in (0, 1]; got "
                f"{len(self.offsets)} contacts, {self.period} s and {self.duty}."
            )
        for name, offset in self.offsets.items():
            if not 0.0 <= offset <= 1.0:
                raise ControlError(f"contact '{name}': an offset lies in [0, 1], got {offset}.")

    def standing(self, time: float) -> frozenset[str]:
        """Return the contacts that stand at a time [s]."""
        return frozenset(name for name in self.offsets if self._phase(name, time) < self.duty)

    def swing(self, contact: str, time: float) -> float | None:
        """Return how much of its swing a contact has done, 0 to 1; None while it stands.

        Raises:
            ControlError: no such contact.
        """
        phase = self._phase(contact, time)
        return None if phase < self.duty else (phase - self.duty) / (1.0 - self.duty)

    def stance(self, contact: str, time: float) -> float | None:
        """Return how much of its stance a contact has done, 0 to 1; None while it swings.

        Raises:
            ControlError: no such contact.
        """
        phase = self._phase(contact, time)
        return phase / self.duty if phase < self.duty else None

    def _phase(self, contact: str, time: float) -> float:
        if contact not in self.offsets:
            raise ControlError(unknown_name("contact", contact, self.offsets))
        return (time / self.period - self.offsets[contact]) % 1.0
