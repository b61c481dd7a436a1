"""Gears behind which a link moves on its own: they wind up, or have play."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, Self, final, get_args

from wbc.effects.joint_effect import GearNumbers
from wbc.robot import Robot, SearchOffer, number
from wbc.transmission import Flanks

Side = Literal["link", "motor", "either"]
SIDES: tuple[Side, ...] = get_args(Side)


_FLANKS = (("stiffness", "stiffness", 0), ("damping", "damping", 0))


@dataclass(frozen=True)
class YieldingGear(GearNumbers, ABC):
    """Base of the effects that let a link stray from its motor, by the law of `Flanks`.

    A simulator carries the deflection as state; along a log the link is simulated behind the gear
    that the robot then has (`change`).

    Attributes:
        friction_side: on which side the friction of this joint rubs along a log: at the link's
            speed, which loads the gear, or at the motor's, which does not. `either` is the link's
            side until a fit has chosen. A simulator has it at the link.
        has_play: whether the link is free between the flanks.
    """

    friction_side: Side = field(default="either", kw_only=True)

    has_play: ClassVar[bool]
    # None: which flanks are worth trying only simulated links tell.
    search = SearchOffer(screens=lambda *_: ())

    @classmethod
    @abstractmethod
    def having(cls, where: str, flanks: Flanks) -> Self:
        """Return the gear of a joint with these flanks."""

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the numbers of a gear that is all but rigid."""
        return {parameter.name: parameter.null for parameter in cls.parameters}

    def with_friction_at(self, side: Side) -> Self:
        """Return the same gear with the joint's friction on that side."""
        return self if side == self.friction_side else replace(self, friction_side=side)


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

    stiffness: float = field(metadata=number("N m/rad", 1e9, 1.0, 1e9, 100.0))
    damping: float = field(metadata=number("N m s/rad", 1.0, 0.0, 1e5, 1.0, shape=True))

    name = "joint_compliance"
    numbers = _FLANKS
    explanation = (
        "Shafts, belts and flex splines wind up: the link lags behind its motor in proportion "
        "to the load and swings after fast moves."
    )
    experiment = (
        "Stop abruptly from fast motion, and hang weights on the link at rest: it rings at one "
        "frequency, and sags while the motor does not."
    )

    has_play: ClassVar[bool] = False
    # A gear that gives and comes back: one that creeps writes down any slow drift.
    search = replace(
        YieldingGear.search, recognisable=lambda own, *_: own.damping < _CREEPS * own.stiffness
    )

    @classmethod
    def having(cls, where: str, flanks: Flanks) -> Self:
        """Return the spring that these flanks are without play."""
        return cls(where, flanks.stiffness, flanks.damping)


_LEAST_PLAY = 1e-4  # [rad]


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

    width: float = field(metadata=number("rad", 0.0, 0.0, 0.5, 0.01, doubt=0.02))
    stiffness: float = field(
        metadata=number("N m/rad", 3000.0, 1.0, 1e7, 1000.0, shape=True, doubt=1.0)
    )
    damping: float = field(metadata=number("N m s/rad", 10.0, 0.0, 1e5, 5.0, shape=True, doubt=1.0))

    name = "backlash"
    numbers = (("width", "backlash", 0), *_FLANKS)
    # What a link does after a strike depends on more than the log shows: on 15 generated logs
    # widths were off by up to 4 %, flanks by factors.
    explanation = (
        "Teeth have clearance: whenever the load changes sign the link travels freely through "
        "it and strikes the other flank."
    )
    experiment = (
        "Hold the motor still and push the link both ways, or swing the load through zero "
        "slowly and fast: the link jumps while the motor does not."
    )

    has_play: ClassVar[bool] = True
    # Flanks without play are a spring.
    search = replace(YieldingGear.search, recognisable=lambda own, *_: own.width > _LEAST_PLAY)

    @classmethod
    def having(cls, where: str, flanks: Flanks) -> Self:
        """Return the play between these flanks."""
        return cls(where, flanks.play, flanks.stiffness, flanks.damping)
