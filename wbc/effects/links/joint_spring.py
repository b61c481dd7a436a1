"""A spring beside the joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen, SearchOffer

_LEAST_TRAVEL = 5e-3  # [rad or m]


def torque(q: FloatArray, stiffness: float, rest: float) -> FloatArray:
    """Return -stiffness * (q - rest) (...) [N m]."""
    return -stiffness * (q - rest)


def _screens(
    kind: type[JointSpring], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen: a spring about zero and one about 1 rad span every rest position."""

    def combine(coefficients: FloatArray) -> dict[str, float]:
        stiffness = float(np.sum(coefficients))
        rest = float(coefficients[1]) / stiffness if stiffness != 0.0 else 0.0
        return {"stiffness": stiffness, "rest": rest}

    units = ({"stiffness": 1.0, "rest": 0.0}, {"stiffness": 1.0, "rest": 1.0})
    return (Screen(units, combine),)


def _recognisable(effect: JointSpring, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether the joint moved: at one place a spring is any constant."""
    positions = np.concatenate([effect.joint_position(robot, motion) for motion in motions])
    return float(np.ptp(positions)) > _LEAST_TRAVEL


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

    name = "joint_spring"
    parameters = (
        Parameter("stiffness", "N m/rad", 0.0, 0.0, 100000.0, 1.0),
        Parameter("rest", "rad", 0.0, -10.0, 10.0, 0.3, shape=True),
    )
    explanation = (
        "A cable loom, a hose or a parallel spring pulls the joint towards a rest position."
    )
    experiment = (
        "Hold the joint at several positions over its range with the load taken off: the "
        "torque is a straight line over position."
    )
    search = SearchOffer(screens=_screens, recognisable=_recognisable)

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return -stiffness * (q - rest) at the joint, (..., nv) [N m]."""
        q = self.joint_position(robot, motion)
        return self.on_joint(robot, motion, torque(q, self.stiffness, self.rest))
