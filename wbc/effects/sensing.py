"""Sensors that report something else than what is true; where contacts touch the ground."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, final

import numpy as np

from wbc.effects.joint_effect import JointEffect
from wbc.robot import Effect, Motion, Robot, SearchOffer, Usual, number


@dataclass(frozen=True)
class ContactNumber(Effect, ABC):
    """Base of the effects that replace a number of a contact point; their one parameter is it.

    Attributes:
        of_contact: its name there.
    """

    of_contact: ClassVar[str]

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every contact point."""
        return tuple(contact.name for contact in robot.contacts)

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the number that the robot has."""
        return {cls.parameters[0].name: getattr(robot.contact(where), cls.of_contact)}

    def change(self, robot: Robot) -> Robot:
        """Return the robot with this number."""
        contact, (value,) = robot.contact(self.where), self.values.values()
        numbers: dict[str, Any] = {self.of_contact: value}
        changed = replace(contact, **numbers)
        return robot.with_contacts(changed if one is contact else one for one in robot.contacts)


# [m] by which feet and ground give way. With the usual contacts of another simulator the balls of a
# quadruped of 13 kg were 1.1 to 1.6 mm smaller, with probabilities up to 0.98.
_GIVES = 1e-3


@final
@dataclass(frozen=True)
class ContactRadius(ContactNumber):
    """The ground is touched by a ball around a contact point, not by the point.

    Attributes:
        radius: of the ball [m]; replaces the robot's value.
    """

    radius: float = field(metadata=number("m", 0.0, 0.0, 1.0, 0.01, usual=Usual(0.0, 0.05, 0.02)))

    of_contact = "radius"
    explanation = (
        "A foot is larger or smaller than described: the ground pushes it this far below the "
        "contact point, so that forces along the ground turn every joint above otherwise."
    )
    experiment = (
        "Measure the foot. Or push the standing robot sideways: the error of all joints of a leg "
        "follows the force along the ground times one length."
    )
    search = SearchOffer(
        tolerated=lambda own, robot, step: (
            ((own.radius - robot.contact(own.where).radius) / _GIVES) ** 2
        )
    )


# Force sensors that are mounted and wired as described are off by some per cent.
_CALIBRATED = Usual(1.0, 1.0, 0.1, factor=True)


@final
@dataclass(frozen=True)
class ForceSensorGain(ContactNumber):
    """The force sensor of a contact reports gain times the true force, on all axes.

    Attributes:
        gain: reported / true force; replaces the robot's value.
    """

    gain: float = field(metadata=number("1", 1.0, 0.2, 5.0, 0.05, usual=_CALIBRATED))

    of_contact = "sensor_gain"
    explanation = "A contact's sensor reports the same share too much or too little of every force."
    experiment = (
        "Weigh the robot on a scale while it stands on this contact alone: what the sensor "
        "reports is off by the gain. A known mass added to the robot changes the reported force "
        "by gain times its weight."
    )


@final
@dataclass(frozen=True)
class PositionOffset(JointEffect):
    """The encoder reports the joint's position plus a constant.

    Attributes:
        offset: reported minus true position [rad].
    """

    offset: float = field(metadata=number("rad", 0.0, -3.2, 3.2, 0.02))

    needs_drive = False
    explanation = (
        "The zero of an encoder was set wrongly or has slipped: gravity pulls as if the joint "
        "stood elsewhere."
    )
    experiment = (
        "Hold still in many poses, some on both sides of hanging straight: the error follows "
        "the slope of the gravity torque and vanishes where that is flat."
    )
    search = SearchOffer(
        inseparable={
            "center_of_mass": (
                "No run tells a wrong zero of a robot's last joint from a centre of mass turned by "
                "the same angle: compare the zero with a mechanical stop or a spirit level, or "
                "balance the link off the robot."
            ),
            "gravity_direction": (
                "No run of a robot on a fixed base tells a wrong zero of its first joint from a "
                "base tilted about that joint's axis: put a spirit level on the base, or mount it "
                "at another known angle."
            ),
        }
    )

    def measured(self, robot: Robot, motion: Motion) -> Motion:
        """Return the motion with the offset added to this joint's position."""
        return self._moved(robot, motion, self.offset)

    def true(self, robot: Robot, motion: Motion) -> Motion:
        """Return the motion with the offset taken from this joint's position."""
        return self._moved(robot, motion, -self.offset)

    def _moved(self, robot: Robot, motion: Motion, change: float) -> Motion:
        position = np.array(motion.position)
        position[..., self.position_row(robot)] += change
        return motion.replace(position=position)
