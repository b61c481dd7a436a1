"""Gears behind which a link moves on its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, Self, get_args

from wbc.effects.joint_effect import JointEffect
from wbc.robot import Robot, SearchOffer
from wbc.transmission import Flanks

Side = Literal["link", "motor", "either"]
SIDES: tuple[Side, ...] = get_args(Side)


@dataclass(frozen=True)
class YieldingGear(JointEffect, ABC):
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

    @abstractmethod
    def change(self, robot: Robot) -> Robot:
        """Return the robot with these flanks in its gear."""

    def with_friction_at(self, side: Side) -> Self:
        """Return the same gear with the joint's friction on that side."""
        return self if side == self.friction_side else replace(self, friction_side=side)
