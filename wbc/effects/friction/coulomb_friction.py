"""Dry friction of constant level."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Motion, Parameter, Robot, SearchOffer


@final
@dataclass(frozen=True)
class CoulombFriction(JointEffect):
    """Dry friction at a joint: -level * sgn(v), anything between at rest.

    Attributes:
        level: [N m], at the joint.
    """

    level: float

    needs_drive = False
    name = "coulomb_friction"
    parameters = (Parameter("level", "N m", 0.0, 0.0, 10000.0, 0.3),)
    explanation = (
        "Surfaces rub in bearings and seals: a torque of constant size opposes any motion, "
        "and holds the joint at rest."
    )
    experiment = (
        "Move the joint slowly back and forth through the same positions: the torque of the "
        "two directions differs by a constant, whatever the load."
    )
    search = SearchOffer(expected=2.0)

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the level at the joint, (..., nv) [N m]."""
        return self.on_joint(robot, motion, self.level)
