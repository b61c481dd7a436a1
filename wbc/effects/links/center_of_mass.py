"""A link whose centre of mass lies elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.effects.links.inertia import reach, require_physical, with_shifted_center
from wbc.effects.links.pseudo_inertia import USUAL
from wbc.robot import Effect, Motion, Parameter, Robot, SearchOffer


def _freedom(effect: CenterOfMass) -> int:
    """The number of directions in which it moved."""
    return max(1, sum(value != 0.0 for value in effect.values.values()))


def _implausibility(effect: CenterOfMass, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return what a centre costs that is shifted by much of the link's reach [nats].

    Drawings are usually wrong by the share of it that `link_inertia` takes, too.
    """
    shift = float(np.linalg.norm([effect.x, effect.y, effect.z]))
    size = reach(robot, robot.body_joint(effect.where))
    return 0.5 * (shift / (USUAL * size)) ** 2 if size > 0.0 else 0.0


@final
@dataclass(frozen=True)
class CenterOfMass(Effect):
    """The centre of mass of a body is shifted; mass and inertia about it stay.

    Attributes:
        x: shift in the frame of the body's joint [m].
        y: likewise.
        z: likewise.
    """

    x: float
    y: float
    z: float

    name = "center_of_mass"
    parameters = (
        Parameter("x", "m", 0.0, -10.0, 10.0, 0.02),
        Parameter("y", "m", 0.0, -10.0, 10.0, 0.02),
        Parameter("z", "m", 0.0, -10.0, 10.0, 0.02),
    )
    explanation = (
        "Cables, covers or a battery sit elsewhere than in the CAD model: the body is as heavy "
        "as the model says but hangs differently."
    )
    experiment = (
        "Hold the body still at many angles: the extra gravity torque is a shifted sine of the "
        "angle, while the total weight on the ground is right."
    )
    search = SearchOffer(freedom=_freedom, implausibility=_implausibility)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every body that has a mass."""
        return tuple(b for b in robot.bodies if robot.model.inertias[robot.body_joint(b)].mass > 0)

    def change(self, robot: Robot) -> Robot:
        """Return the robot with the centre of mass moved."""
        joint = robot.body_joint(self.where)
        before = robot.model.inertias[joint]
        after = with_shifted_center(before, np.array([self.x, self.y, self.z]))
        return robot.with_inertia(joint, require_physical(before, after, self.where))
