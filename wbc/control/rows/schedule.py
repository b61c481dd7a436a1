"""Which contacts stand when, and how they take up and give off their load."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import final

from wbc.arrays import require_ranges
from wbc.errors import ControlError, require_known


@final
class ContactRamp:
    """Greatest normal forces of contacts that come and go along ramps.

    A contact that is wanted no longer loses its ceiling in a straight line and leaves the set when
    the ceiling reaches zero; one that is wanted again gets it back in the same way, and is free at
    the end. A ceiling that is asked for is kept at once. A controller has one of its own, see
    `ControllerSettings.contact_ramp`; a slower one before it unloads a foot in time:

        ramp = ContactRamp(["left", "right"], load=weight, duration=0.2)
        ...
        command = controller.step(state, references, ramp.step({"left"}, dt))
    """

    def __init__(
        self, contacts: Sequence[str], load: float, duration: float, *, rise: float | None = None
    ) -> None:
        """Start with every contact active.

        Args:
            contacts: names of all contacts.
            load: normal force [N] from which and to which the ceilings go, for example the weight.
            duration: of a ramp [s].
            rise: of a ramp upwards [s] where that is another one. Flags that flicker evenly end
                with all contacts active where it is shorter.

        Raises:
            ControlError: no contact, or a load or duration that is not positive.
        """
        rise = duration if rise is None else rise
        if not contacts or not load > 0.0 or not duration > 0.0 or not rise > 0.0:
            raise ControlError("a contact ramp needs contacts, a load > 0 N and a duration > 0 s.")
        self._load, self._fall, self._rise = load, 1.0 / duration, 1.0 / rise
        self._share = dict.fromkeys(contacts, 1.0)

    def step(
        self, wanted: Collection[str] | Mapping[str, float], dt: float, *, at_once: bool = False
    ) -> Mapping[str, float]:
        """Go on for `dt` [s]; return the ceiling [N] of every contact that may carry force.

        Args:
            wanted: the contacts that are to carry force, or their ceilings.
            dt: [s].
            at_once: whether to begin with what is wanted, without a ramp.

        Raises:
            ControlError: a contact that there is not.
        """
        for name in wanted:
            require_known(ControlError, "contact", name, self._share)
        given = wanted if isinstance(wanted, Mapping) else dict.fromkeys(wanted, inf)
        fall, rise = (inf, inf) if at_once else (dt * self._fall, dt * self._rise)
        ceilings = {}
        for name, share in self._share.items():
            ceiling = given.get(name, 0.0)
            goal = min(ceiling / self._load, 1.0)
            share = min(goal, share + rise) if goal > 0.0 else max(share - fall, 0.0)
            self._share[name] = share
            if share > 0.0:
                ceilings[name] = ceiling if share == goal else share * self._load
        return ceilings


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
        ranges = {"period": "> 0 s and < inf", "duty": "> 0 and <= 1"}
        require_ranges(self, "contact schedule: ", ControlError, **ranges)
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

    def _phase(self, contact: str, time: float) -> float:
        require_known(ControlError, "contact", contact, self.offsets)
        return (time / self.period - self.offsets[contact]) % 1.0
