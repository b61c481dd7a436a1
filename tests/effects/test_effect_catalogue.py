"""Every effect explains itself, and tables of effects give what their hooks give."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, final

import numpy as np
import pytest

from tests.effects.needed import motion_of, needed
from wbc.arrays import FloatArray
from wbc.effects import EFFECTS, CoulombFriction, JointEffect, load_robot, save_robot
from wbc.effects.tables import left_for_hooks
from wbc.errors import EffectError
from wbc.robot import Effect, Motion, Parameter, Robot
from wbc.robot.description import SI_UNITS


def away_from_null(kind: type[Effect], robot: Robot, where: str) -> Effect:
    """Return the effect one typical size away from where it is not there, inside its bounds."""
    values = kind.null_values(robot, where)
    for parameter in kind.at(where, values).parameters:  # an effect may have some per link
        value = values[parameter.name]
        outside = value + parameter.scale > parameter.high
        values[parameter.name] = value + (-parameter.scale if outside else parameter.scale)
    return kind.at(where, values)


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_it_explains_itself(name: str) -> None:
    kind = EFFECTS[name]
    assert kind.name == name
    assert kind.parameters
    assert min(len(kind.explanation), len(kind.experiment)) > 20
    for parameter in kind.parameters:
        assert SI_UNITS[parameter.unit] == (parameter.unit, 1.0)
        assert parameter.low < parameter.high
        assert parameter.low <= parameter.null <= parameter.high
        assert 0.0 < parameter.scale <= parameter.high - parameter.low


def fitting(name: str, robot: str) -> Robot:
    """Return `robot`, or one with coupled gears for effects that sit at a coupled motor."""
    coupled = name.startswith("rotor_") and "friction" in name
    return load_robot("parallelogram_leg" if coupled else robot)


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_at_its_null_value_it_changes_nothing_anywhere(name: str) -> None:
    robot, kind = fitting(name, "planar_leg_fixed"), EFFECTS[name]
    motion = motion_of(robot)
    places = kind.places(robot)
    assert places
    for where in places:
        null = kind.at(where, kind.null_values(robot, where))
        added = needed(robot.with_effect(null), motion) - needed(robot, motion)
        np.testing.assert_allclose(added, 0.0, atol=1e-12)
        np.testing.assert_allclose(null.measured(robot, motion).position, motion.position)


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_bounds_and_places_are_kept(name: str) -> None:
    robot, kind = fitting(name, "planar_leg"), EFFECTS[name]
    effect = away_from_null(kind, robot, kind.places(robot)[-1])
    for parameter in effect.parameters[: len(kind.parameters)]:
        for value in (parameter.low - 1e-3, parameter.high * 1.01 + 1e-3, np.nan):
            with pytest.raises(EffectError, match=f"{name} at .*{parameter.name}"):
                effect.with_values({parameter.name: value})
    with pytest.raises(EffectError, match=f"Unknown place for {name} 'nowhere'"):
        robot.with_effect(kind.at("nowhere", effect.values))
    with pytest.raises(EffectError, match=f"Unknown parameter of {name} 'strength'"):
        kind.at("knee", {"strength": 1.0})


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_it_survives_saving_and_leaves_the_robot_it_was_added_to_alone(
    name: str, tmp_path: Path
) -> None:
    robot, kind = fitting(name, "planar_leg"), EFFECTS[name]
    before, gravity = robot.model.copy().inertias, robot.model.gravity.linear.copy()
    for where in kind.places(robot):
        added = robot.with_effect(away_from_null(kind, robot, where))
        again = load_robot(save_robot(added, tmp_path / "robot.toml"))
        assert again.effects == added.effects
    assert all(i == j for i, j in zip(robot.model.inertias, before, strict=True))
    np.testing.assert_array_equal(robot.model.gravity.linear, gravity)
    assert robot.effects == ()


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
        drag = self.coefficient * float(motion.velocity[row]) ** 3
        return max(-self.most, min(-drag, self.most)) * np.eye(len(motion.velocity))[row]


@final
@dataclass(frozen=True)
class DragWithBranch(Drag):
    """The same, with a branch that does not ask each joint for itself."""

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        speed = self.joint_velocity(robot, motion)
        if np.abs(speed).max() < 0.5:
            return np.zeros(motion.velocity.shape)
        return self.on_joint(robot, motion, -self.coefficient * speed**3)


@pytest.mark.parametrize(
    ("effects", "asked"),
    [
        ((Drag("hip", 0.1), Drag("knee", 0.2)), 1),
        # What is no parameter is the same for all places of one effect.
        ((Drag("hip", 0.1), Drag("knee", 0.1, 2.0)), 2),
        ((DragOfOneSample("hip", 0.1), DragOfOneSample("knee", 0.2)), 2),
        ((DragWithBranch("hip", 0.1), DragWithBranch("knee", 0.2)), 2),
    ],
)
def test_a_users_effect_is_asked_once_for_all_places_where_it_can_be(
    effects: tuple[Effect, ...], asked: int
) -> None:
    """Written in plain NumPy for one joint, it takes all joints at once, or place by place."""
    robot = load_robot("planar_leg_fixed").with_effects(*effects)
    left = left_for_hooks(robot)
    assert len(left) == asked
    for v in np.random.default_rng(5).normal(size=(5, 2)):
        found = sum(effect.joint_torque(robot, Motion(np.zeros(2), v)) for effect in left)
        alone = sum(effect.joint_torque(robot, Motion(np.zeros(2), v)) for effect in effects)
        np.testing.assert_allclose(found, alone, rtol=1e-13)


def test_a_size_of_two_digits_has_no_exponent() -> None:
    sizes = {162.3: "160 N m", 20.6: "21 N m", 0.5012: "0.5 N m", 1234.0: "1200"}
    for level, said in sizes.items():
        assert f"Coulomb friction of {said}" in CoulombFriction("knee", level).said()
