"""A spring beside the joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Motion, Parameter, Robot


@final
@dataclass(frozen=True)
class JointSpring(JointEffect):
    """A torque -stiffness * (q - rest) at a joint.

    Attributes:
        stiffness: [N m/rad].
        rest: position at which the spring is slack [rad].
    """

    stiffness: float
    rest: float

    name: ClassVar[str] = "joint_spring"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("stiffness", "N m/rad", 0.0, 0.0, 100000.0, 1.0),
        Parameter("rest", "rad", 0.0, -10.0, 10.0, 0.3, shape=True),
    )
    explanation: ClassVar[str] = (
        "A cable loom, a hose or a parallel spring pulls the joint towards a rest position."
    )
    experiment: ClassVar[str] = (
        "Hold the joint at several positions over its range with the load taken off: the "
        "torque is a straight line over position."
    )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return -stiffness * (q - rest) at the joint, (..., nv) [N m]."""
        stretch = self.joint_position(robot, motion) - self.rest
        return self.on_joint(robot, motion, -self.stiffness * stretch)
