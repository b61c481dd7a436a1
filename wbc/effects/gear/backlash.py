"""Free play between motor and link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self, final

from wbc.effects.gear.yielding_gear import YieldingGear
from wbc.robot import Motion, Parameter, Robot
from wbc.transmission import Flanks

_LEAST_PLAY = 1e-4  # [rad]


def _recognisable(effect: Backlash, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether there is play to speak of: flanks without it are a spring."""
    return effect.width > _LEAST_PLAY


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

    name = "backlash"
    # What a link does after a strike depends on more than the log shows: on 15 generated logs
    # widths were off by up to 4 %, flanks by factors.
    parameters = (
        Parameter("width", "rad", 0.0, 0.0, 0.5, 0.01, doubt=0.02),
        Parameter("stiffness", "N m/rad", 3000.0, 1.0, 1e7, 1000.0, shape=True, doubt=1.0),
        Parameter("damping", "N m s/rad", 10.0, 0.0, 1e5, 5.0, shape=True, doubt=1.0),
    )
    explanation = (
        "Teeth have clearance: whenever the load changes sign the link travels freely through "
        "it and strikes the other flank."
    )
    experiment = (
        "Hold the motor still and push the link both ways, or swing the load through zero "
        "slowly and fast: the link jumps while the motor does not."
    )

    has_play: ClassVar[bool] = True
    search = replace(YieldingGear.search, recognisable=_recognisable)

    @classmethod
    def having(cls, where: str, flanks: Flanks) -> Self:
        """Return the play between these flanks."""
        return cls(where, flanks.play, flanks.stiffness, flanks.damping)

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
