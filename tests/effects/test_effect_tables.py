"""Tables of effects do what the hooks of the same effects do, one place after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np
import pytest

from wbc import load_robot
from wbc.arrays import FloatArray
from wbc.effects import JointEffect
from wbc.effects.tables import (
    left_for_hooks,
)
from wbc.robot import Effect, Motion, Parameter, Robot


def by_hooks(robot: Robot, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return smooth torque and dry level of all effects of a robot."""
    smooth, dry = np.zeros_like(motion.velocity), np.zeros_like(motion.velocity)
    for effect in robot.effects:
        torque, level = effect.joint_torque(robot, motion), effect.joint_friction(robot, motion)
        smooth += 0.0 if torque is None else torque
        dry += 0.0 if level is None else level
    return smooth, dry


@dataclass(frozen=True)
class Drag(JointEffect):
    """A user's effect: -coefficient v^3, at most `most`."""

    coefficient: float
    most: float = 5.0

    name: ClassVar[str] = "drag"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("coefficient", "N m s^3/rad^3", 0.0, 0.0, 10.0, 0.1),
    )
    explanation: ClassVar[str] = "A drag."
    experiment: ClassVar[str] = "Move fast."

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        drag = self.coefficient * self.joint_velocity(robot, motion) ** 3
        return self.on_joint(robot, motion, np.clip(-drag, -self.most, self.most))


@final
@dataclass(frozen=True)
class DragOfOneSample(Drag):
    """The same, for one number only."""

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        row = robot.velocity_index(self.where)
        result = np.zeros(motion.velocity.shape)
        drag = self.coefficient * float(motion.velocity[row]) ** 3
        result[row] = max(-self.most, min(-drag, self.most))
        return result


@final
@dataclass(frozen=True)
class DragWithBranch(Drag):
    """The same, with a branch that does not ask each joint for itself."""

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        speed = self.joint_velocity(robot, motion)
        if np.abs(speed).max() < 0.5:
            return np.zeros(motion.velocity.shape)
        return self.on_joint(robot, motion, -self.coefficient * speed**3)


def test_a_users_effect_is_asked_once_for_all_its_places(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Written in plain NumPy for one joint, it takes twelve joints at once."""
    bare = load_robot("solo12")
    joints = bare.transmission.joints
    robot = bare.with_effects(*[Drag(j, 0.1 + 0.01 * i) for i, j in enumerate(joints)])
    (one,) = left_for_hooks(robot)
    random = np.random.default_rng(5)
    for shape in ((), (7,)):
        q, v = (random.normal(size=(*shape, n)) for n in (robot.model.nq, robot.model.nv))
        torque = one.joint_torque(robot, Motion(q, v))
        assert torque is not None
        np.testing.assert_allclose(torque, by_hooks(robot, Motion(q, v))[0], rtol=1e-13)


def test_effects_with_other_constants_are_not_joined() -> None:
    """What is no parameter is the same for all places of one effect."""
    robot = load_robot("planar_leg_fixed").with_effects(Drag("hip", 0.1), Drag("knee", 0.1, 2.0))
    assert [effect.where for effect in left_for_hooks(robot)] == ["hip", "knee"]


@pytest.mark.parametrize("kind", [DragOfOneSample, DragWithBranch])
def test_a_users_hook_that_takes_no_arrays_is_asked_place_by_place(
    kind: Callable[[str, float], Effect],
) -> None:
    """It works as it is."""
    robot = load_robot("planar_leg_fixed").with_effects(kind("hip", 0.1), kind("knee", 0.2))
    assert left_for_hooks(robot) == robot.effects
