"""Free play between motor and link."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self, final

from wbc.arrays import FloatArray
from wbc.effects.flanks import Contact
from wbc.effects.loose_search import best_contacts
from wbc.effects.striking_links import struck_deflections
from wbc.effects.yielding_gear import YieldingGear, by_side
from wbc.robot import Evidence, LinkResponse, Motion, Parameter, Robot, Screen

_PLAYS = (0.004, 0.006, 0.009, 0.014, 0.02, 0.03, 0.045)  # [rad]
_LEAST_PLAY = 1e-4  # [rad]
_FLANK = 25.0  # [Hz]
_DAMPING = 0.15  # of the critical one, to begin with


@final
@dataclass(frozen=True)
class Backlash(YieldingGear):
    """The link is free to move within `width` of its motor and bounces on stiff flanks.

    Positions are those of the motor: the link's own are hidden, and its inertia leaves and
    strikes the gear at every reversal of the load.

    Attributes:
        width: whole play [rad] at the joint.
        stiffness: of the flanks [N m/rad].
        damping: of the flanks [N m s/rad].
    """

    width: float
    stiffness: float
    damping: float

    name: ClassVar[str] = "backlash"
    # What a link does after a strike depends on more than the log shows: on 15 generated logs
    # widths were off by up to 4 %, flanks by factors.
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("width", "rad", 0.0, 0.0, 0.5, 0.01, doubt=0.02),
        Parameter("stiffness", "N m/rad", 3000.0, 1.0, 1e7, 1000.0, shape=True, doubt=1.0),
        Parameter("damping", "N m s/rad", 10.0, 0.0, 1e5, 5.0, shape=True, doubt=1.0),
    )
    explanation: ClassVar[str] = (
        "Teeth have clearance: whenever the load changes sign the link travels freely through "
        "it and strikes the other flank."
    )
    experiment: ClassVar[str] = (
        "Hold the motor still and push the link both ways, or swing the load through zero "
        "slowly and fast: the link jumps while the motor does not."
    )

    @classmethod
    def screening(cls, robot: Robot, where: str, evidence: Evidence) -> tuple[Screen, ...]:
        """Return the plays and flanks that explain the unexplained torque best."""
        return tuple(
            Screen.fixed(
                {"width": c.play, "stiffness": c.stiffness, "damping": c.damping},
                friction_side=side,
            )
            for side, responses in by_side(evidence, where)
            for c in best_contacts(responses, count=2)
        )

    @classmethod
    def coarsely(cls, where: str, inertia: float) -> Iterator[Self]:
        """Yield plays from 4 to 45 mrad between flanks on which the link swings at 25 Hz."""
        for play in _PLAYS:
            contact = Contact.swinging(inertia, _FLANK, _DAMPING, play)
            yield cls(where, play, contact.stiffness, contact.damping)

    def change(self, robot: Robot) -> Robot:
        """Return the robot whose gear has this play."""
        gears = robot.transmission
        for name, value in (
            ("backlash", self.width),
            ("stiffness", self.stiffness),
            ("damping", self.damping),
        ):
            gears = gears.with_value(name, self.where, value)
        return robot.with_transmission(gears)

    def recognisable(self, robot: Robot, motions: Sequence[Motion]) -> bool:
        """Whether there is play to speak of: flanks without it are a spring."""
        return self.width > _LEAST_PLAY

    def contact(self) -> Contact:
        """Return the flanks of the gear."""
        return Contact(self.stiffness, self.damping, self.width)

    def deflection(self, robot: Robot, response: LinkResponse) -> FloatArray:
        """Return the link's motion relative to the motor, (N, 3), and its dry friction if any."""
        return struck_deflections([response], [self.contact()])[0]
