"""A gear that winds up under load."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self, final

from wbc.effects.flanks import Contact
from wbc.effects.soft_search import best_springs
from wbc.effects.yielding_gear import YieldingGear, by_side
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen

_SWINGS = (3.5, 7.0, 14.0)  # [Hz]
_DAMPING = 0.15  # of the critical one, to begin with
_CREEPS = 0.5  # [s], damping over stiffness


@final
@dataclass(frozen=True)
class JointCompliance(YieldingGear):
    """A spring and a damper between motor and link.

    Positions are those of the motor; the link lags by load / stiffness and may swing.

    Attributes:
        stiffness: [N m/rad] at the joint.
        damping: [N m s/rad].
    """

    stiffness: float
    damping: float

    name: ClassVar[str] = "joint_compliance"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("stiffness", "N m/rad", 1e9, 1.0, 1e9, 100.0),
        Parameter("damping", "N m s/rad", 1.0, 0.0, 1e5, 1.0, shape=True),
    )
    explanation: ClassVar[str] = (
        "Shafts, belts and flex splines wind up: the link lags behind its motor in proportion "
        "to the load and swings after fast moves."
    )
    experiment: ClassVar[str] = (
        "Stop abruptly from fast motion, and hang weights on the link at rest: it rings at one "
        "frequency, and sags while the motor does not."
    )

    @classmethod
    def screening(cls, robot: Robot, where: str, evidence: Evidence) -> tuple[Screen, ...]:
        """Return the stiffnesses that explain the unexplained torque best."""
        return tuple(
            Screen.fixed({"stiffness": k, "damping": c}, friction_side=side)
            for side, responses in by_side(evidence, where)
            for k, c in best_springs(responses, count=2)
        )

    @classmethod
    def coarsely(cls, where: str, inertia: float) -> Iterator[Self]:
        """Yield springs behind which the link swings at 3.5, 7 and 14 Hz."""
        for frequency in _SWINGS:
            contact = Contact.swinging(inertia, frequency, _DAMPING)
            yield cls(where, contact.stiffness, contact.damping)

    def recognisable(self, robot: Robot, motions: Sequence[Motion]) -> bool:
        """Whether the gear gives and comes back: one that creeps writes down any slow drift."""
        return self.damping < _CREEPS * self.stiffness

    def change(self, robot: Robot) -> Robot:
        """Return the robot whose gear is that soft."""
        gears = robot.transmission.with_value("stiffness", self.where, self.stiffness)
        return robot.with_transmission(gears.with_value("damping", self.where, self.damping))

    def contact(self) -> Contact:
        """Return the spring as flanks without play."""
        return Contact(self.stiffness, self.damping, 0.0)

    def spring(self) -> tuple[float, float]:
        """Return stiffness and damping."""
        return self.stiffness, self.damping
