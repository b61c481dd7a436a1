"""Tables of effects do what the hooks of the same effects do, one place after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np
import pytest

from tests.effects.test_frozen_effects import LAWS
from wbc import load_robot
from wbc.arrays import FloatArray
from wbc.effects import JointEffect, effect_class
from wbc.effects.tables import (
    effect_table,
    fill_commands,
    fill_delivered,
    fill_efficiencies,
    fill_joint_torques,
    left_for_hooks,
)
from wbc.robot import Effect, Motion, Parameter, Robot

MANY = {**LAWS, "load_stribeck_friction": (0.1, 0.3)}


def with_kinds(robot: Robot, *kinds: str) -> Robot:
    """Return the robot with effects at all its driven joints, in numbers that differ by place."""
    added = []
    for kind in kinds:
        cls = effect_class(kind)
        names = [parameter.name for parameter in cls.parameters]
        for i, joint in enumerate(robot.transmission.joints):
            numbers = [MANY[kind][0] * (1.0 + 0.1 * i), *MANY[kind][1:]]
            added.append(cls.at(joint, dict(zip(names, numbers, strict=True))))
    return robot.with_effects(*added)


def by_hooks(robot: Robot, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return smooth torque and dry level of all effects of a robot."""
    smooth, dry = np.zeros_like(motion.velocity), np.zeros_like(motion.velocity)
    for effect in robot.effects:
        torque, level = effect.joint_torque(robot, motion), effect.joint_friction(robot, motion)
        smooth += 0.0 if torque is None else torque
        dry += 0.0 if level is None else level
    return smooth, dry


@pytest.mark.parametrize("name", ["planar_leg", "solo12"])
def test_the_table_of_many_effects_does_what_their_hooks_do(name: str) -> None:
    """Joint torques, drives both ways and efficiencies, at 20 random samples."""
    robot = with_kinds(load_robot(name), *MANY)
    table, gears = effect_table(robot), robot.transmission
    assert left_for_hooks(robot) == ()
    assert table.act_on_joints
    assert table.act_on_drives
    assert table.act_on_gears
    random = np.random.default_rng(3)
    for _ in range(20):
        q, v = random.normal(size=robot.model.nq), 0.4 * random.normal(size=robot.model.nv)
        motion = Motion(q, v)
        smooth, dry = np.full((2, robot.model.nv), np.nan)
        fill_joint_torques(table.joints, table.numbers, q, v, smooth, dry)
        wanted = by_hooks(robot, motion)
        np.testing.assert_allclose(smooth, wanted[0], rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(dry, wanted[1], rtol=1e-12, atol=1e-15)

        asked = random.normal(size=gears.size) / np.abs(gears.gear_ratio)
        given, command, added = asked, asked, np.zeros(gears.size)
        for effect in robot.effects:
            given = effect.drive(robot, motion, given)
            more = effect.rotor_torque(robot, motion)
            added = added if more is None else added + more
        command = command - added
        for effect in reversed(robot.effects):
            command = effect.drive_inverse(robot, motion, command)
        found, back = np.full((2, gears.size), np.nan)
        fill_delivered(table.drives, asked, found)
        fill_commands(table.drives, asked, back)
        np.testing.assert_allclose(found, given + added, rtol=1e-12)
        np.testing.assert_allclose(back, command, rtol=1e-12)

        turning = gears.motor_from_joint @ v[robot.actuated]
        forward, backward = np.full((2, gears.size), np.nan)
        usual = gears.forward_efficiency, gears.backward_efficiency
        fill_efficiencies(table.gears, turning, *usual, forward, backward)
        now = robot.gear_efficiencies(motion)
        np.testing.assert_allclose(forward, now[0], rtol=1e-12)
        np.testing.assert_allclose(backward, now[1], rtol=1e-12)


def test_a_limit_before_a_factor_is_not_a_limit_behind_it() -> None:
    """Drives act in the order of the effects."""
    leg = load_robot("planar_leg_fixed")
    limit = effect_class("current_limit").at("knee", {"limit": 2.0})
    factor = effect_class("torque_constant").at("knee", {"factor": 1.5})
    command, given = np.array([0.0, 1.0]), np.zeros(2)
    for effects, largest in (((limit, factor), 3.0), ((factor, limit), 2.0)):
        fill_delivered(effect_table(leg.with_effects(*effects)).drives, command, given)
        assert given[1] * leg.transmission.gear_ratio[1] == pytest.approx(largest)


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
