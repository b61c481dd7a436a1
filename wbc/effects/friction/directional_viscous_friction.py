"""Friction proportional to speed, with another factor in each direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Motion, Parameter, Robot, SearchOffer


def torque(v: FloatArray, positive: float, negative: float) -> FloatArray:
    """Return -positive * v (...) [N m] where v > 0 and -negative * v where v < 0."""
    return -(positive * np.maximum(v, 0.0) + negative * np.minimum(v, 0.0))


def _recognisable(
    effect: DirectionalViscousFriction, robot: Robot, motions: Sequence[Motion]
) -> bool:
    """Whether the joint moved in both directions: in one alone this is viscous friction."""
    speeds = np.concatenate([effect.joint_velocity(robot, motion) for motion in motions])
    return bool(np.min(speeds) < 0.0 < np.max(speeds))


@final
@dataclass(frozen=True)
class DirectionalViscousFriction(JointEffect):
    """A torque -positive_direction * v at a joint for v > 0 and -negative_direction * v for v < 0.

    With both equal it is viscous friction.

    Attributes:
        positive_direction, negative_direction: [N m s/rad], at the joint.
    """

    positive_direction: float
    negative_direction: float

    name = "directional_viscous_friction"
    parameters = (
        Parameter("positive_direction", "N m s/rad", 0.0, 0.0, 10000.0, 0.1),
        Parameter("negative_direction", "N m s/rad", 0.0, 0.0, 10000.0, 0.1),
    )
    explanation = (
        "Lip seals, spindles and lubricant that is pumped one way drag more in one direction of "
        "motion than in the other."
    )
    experiment = (
        "Move the joint at several constant speeds in both directions: the extra torque lies on "
        "two straight lines through zero, one per direction, of different slope."
    )
    search = SearchOffer(
        claims=2,  # friction, and that it differs by direction
        recognisable=_recognisable,
    )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the torque at the joint, (..., nv) [N m]."""
        v = self.joint_velocity(robot, motion)
        drag = torque(v, self.positive_direction, self.negative_direction)
        return self.on_joint(robot, motion, drag)
