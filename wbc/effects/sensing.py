"""Sensors that report something else than what is true."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.effects.joint_effect import JointEffect
from wbc.robot import Motion, Robot, SearchOffer, number


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
