"""A gear that winds up under load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self, final

from wbc.effects.gear.yielding_gear import YieldingGear
from wbc.robot import Motion, Parameter, Robot
from wbc.transmission import Flanks

_CREEPS = 0.5  # [s], damping over stiffness


def _recognisable(effect: JointCompliance, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether the gear gives and comes back: one that creeps writes down any slow drift."""
    return effect.damping < _CREEPS * effect.stiffness


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

    name = "joint_compliance"
    parameters = (
        Parameter("stiffness", "N m/rad", 1e9, 1.0, 1e9, 100.0),
        Parameter("damping", "N m s/rad", 1.0, 0.0, 1e5, 1.0, shape=True),
    )
    explanation = (
        "Shafts, belts and flex splines wind up: the link lags behind its motor in proportion "
        "to the load and swings after fast moves."
    )
    experiment = (
        "Stop abruptly from fast motion, and hang weights on the link at rest: it rings at one "
        "frequency, and sags while the motor does not."
    )

    has_play: ClassVar[bool] = False
    search = replace(YieldingGear.search, recognisable=_recognisable)

    @classmethod
    def having(cls, where: str, flanks: Flanks) -> Self:
        """Return the spring that these flanks are without play."""
        return cls(where, flanks.stiffness, flanks.damping)

    def change(self, robot: Robot) -> Robot:
        """Return the robot whose gear is that soft."""
        gears = robot.transmission.with_value("stiffness", self.where, self.stiffness)
        return robot.with_transmission(gears.with_value("damping", self.where, self.damping))
