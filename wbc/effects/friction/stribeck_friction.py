"""Dry friction that is larger near standstill."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen, SearchOffer


def level_at(v: FloatArray, level: float, speed: float) -> FloatArray:
    """Return level * exp(-(v/speed)^2) (...) [N m]."""
    return level * np.exp(-((v / speed) ** 2))


def _screens(
    kind: type[StribeckFriction], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per Stribeck speed, from a tenth to half of the speeds seen."""
    row = robot.velocity_index(where)
    seen = np.concatenate([np.abs(motion.velocity[:, row]) for motion in evidence.motions])
    usual = float(np.sqrt(np.mean(seen**2)))
    if usual == 0.0:
        return ()

    def screen(speed: float) -> Screen:
        unit = {"level": 1.0, "speed": speed}
        return Screen((unit,), lambda c: {"level": float(c[0]), "speed": speed})

    speeds = np.clip(usual * np.geomspace(0.08, 0.8, 6), 0.001, 20.0)
    return tuple(screen(float(speed)) for speed in speeds)


def _recognisable(effect: StribeckFriction, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether the joint passed twice the Stribeck speed: below it this is Coulomb friction."""
    fastest = max(np.abs(effect.joint_velocity(robot, motion)).max() for motion in motions)
    return bool(2.0 * effect.speed < fastest)


@final
@dataclass(frozen=True)
class StribeckFriction(JointEffect):
    """Extra dry friction near rest: level * exp(-(v/speed)^2) (Armstrong's form, exponent 2).

    It comes on top of Coulomb friction, which it exceeds only below a few times `speed`.

    Attributes:
        level: [N m] at zero speed, at the joint.
        speed: Stribeck speed [rad/s].
    """

    level: float
    speed: float

    name = "stribeck_friction"
    parameters = (
        Parameter("level", "N m", 0.0, 0.0, 10000.0, 0.3),
        Parameter("speed", "rad/s", 0.1, 0.001, 20.0, 0.1, shape=True),
    )
    explanation = (
        "At low speed the lubricant film breaks and metal touches metal: friction falls as "
        "the joint picks up speed."
    )
    experiment = (
        "Move the joint through standstill very slowly, then at growing speeds: the torque "
        "first falls with speed, then rises."
    )
    search = SearchOffer(near_rest=True, screens=_screens, recognisable=_recognisable)

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the level at the present speed, (..., nv) [N m]."""
        speed = self.joint_velocity(robot, motion)
        return self.on_joint(robot, motion, level_at(speed, self.level, self.speed))
