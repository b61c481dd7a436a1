"""Gears behind which a link moves on its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal, Self, get_args

from wbc.effects.flanks import Contact
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, LinkResponse

Side = Literal["link", "motor", "either"]
SIDES: tuple[Side, ...] = get_args(Side)


@dataclass(frozen=True)
class YieldingGear(JointEffect, ABC):
    """Base of the effects that let a link stray from its motor.

    Attributes:
        friction_side: on which side the friction of this joint rubs along a log: at the link's
            speed, which loads the gear, or at the motor's, which does not. `either` is the link's
            side until a fit has chosen. A simulator has it at the link.
    """

    friction_side: Side = field(default="either", kw_only=True)

    @classmethod
    @abstractmethod
    def coarsely(cls, where: str, inertia: float) -> Iterator[Self]:
        """Yield gears over a coarse grid, in front of a link of that inertia [kg m^2]."""

    @abstractmethod
    def contact(self) -> Contact:
        """Return the flanks of the gear; without play it is a spring."""

    def with_friction_at(self, side: Side) -> Self:
        """Return the same gear with the joint's friction on that side."""
        return self if side == self.friction_side else replace(self, friction_side=side)


def by_side(evidence: Evidence, joint: str) -> list[tuple[Side, tuple[LinkResponse, ...]]]:
    """Return the sides on which the friction known at a joint may rub, with the link's responses.

    `responses` are those of a link without friction: where it rubs at the motor.
    """
    rubbing = evidence.rubbing(joint)
    if not rubbing:
        return [("either", evidence.responses(joint))]
    return [("motor", evidence.responses(joint)), ("link", rubbing)]
