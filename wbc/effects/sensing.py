"""Sensors that report something else than what is true."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.effects.joint_effect import JointEffect
from wbc.robot import ContactForces, Effect, Motion, Robot, SearchOffer, Usual, number


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


# Force sensors that are mounted and wired as described are off by some per cent.
_CALIBRATED = Usual(1.0, 1.0, 0.1, factor=True)


@final
@dataclass(frozen=True)
class ForceSensorGain(Effect):
    """The force sensor of a contact reports gain times the true force, on all axes.

    Attributes:
        gain: reported / true force.
    """

    gain: float = field(metadata=number("1", 1.0, 0.2, 5.0, 0.05, usual=_CALIBRATED))

    explanation = "A contact's sensor reports the same share too much or too little of every force."
    experiment = (
        "Weigh the robot on a scale while it stands on this contact alone: what the sensor "
        "reports is off by the gain. A known mass added to the robot changes the reported force "
        "by gain times its weight."
    )

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every contact."""
        return tuple(contact.name for contact in robot.contacts)

    def measured_forces(self, robot: Robot, forces: ContactForces) -> ContactForces:
        """Return the forces with this contact's multiplied by the gain."""
        return self._scaled(forces, self.gain)

    def true_forces(self, robot: Robot, forces: ContactForces) -> ContactForces:
        """Return the forces with this contact's divided by the gain."""
        return self._scaled(forces, 1.0 / self.gain)

    def _scaled(self, forces: ContactForces, factor: float) -> ContactForces:
        if self.where not in forces:
            return forces
        return {**forces, self.where: factor * forces[self.where]}
