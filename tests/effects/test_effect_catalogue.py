"""What every effect of the catalogue owes its users, whatever it does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wbc.arrays import FloatArray
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import EFFECTS, load_robot, save_robot
from wbc.errors import EffectError
from wbc.robot import Effect, Motion, Robot
from wbc.robot.loading.table import SI_UNITS

SAMPLES = 20


def motion_of(robot: Robot) -> Motion:
    q, v, a = np.random.default_rng(9).normal(size=(3, SAMPLES, robot.model.nv))
    return Motion(
        q,
        v,
        a,
        time=0.01 * np.arange(SAMPLES),
        temperature=np.full((SAMPLES, 2), 40.0),
        supply_voltage=np.full((SAMPLES, 2), 24.0),
    )


def needed(robot: Robot, motion: Motion) -> FloatArray:
    return rotor_torque(robot, motion, link_torque(robot, motion))[0]


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
    assert len(kind.explanation) > 20
    assert len(kind.experiment) > 20
    for parameter in kind.parameters:
        assert parameter.unit in SI_UNITS
        assert SI_UNITS[parameter.unit] == (parameter.unit, 1.0)
        assert parameter.low < parameter.high
        assert parameter.low <= parameter.null <= parameter.high
        assert 0.0 < parameter.scale <= parameter.high - parameter.low


def fitting(name: str, robot: str) -> Robot:
    """Return `robot`, or one with coupled gears for effects that sit at a coupled motor."""
    return load_robot(
        "parallelogram_leg" if name.startswith("rotor_") and "friction" in name else robot
    )


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_at_its_null_value_it_changes_nothing_anywhere(name: str) -> None:
    robot, kind = fitting(name, "planar_leg_fixed"), EFFECTS[name]
    motion = motion_of(robot)
    places = kind.places(robot)
    assert places
    for where in places:
        null = kind.at(where, kind.null_values(robot, where))
        np.testing.assert_allclose(
            needed(robot.with_effect(null), motion), needed(robot, motion), rtol=0, atol=1e-12
        )
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
    before = [inertia.copy() for inertia in robot.model.inertias]
    gravity = robot.model.gravity.linear.copy()
    for where in kind.places(robot):
        added = robot.with_effect(away_from_null(kind, robot, where))
        again = load_robot(save_robot(added, tmp_path / "robot.toml"))
        assert again.effects == added.effects
    assert all(i == j for i, j in zip(robot.model.inertias, before, strict=True))
    np.testing.assert_array_equal(robot.model.gravity.linear, gravity)
    assert robot.effects == ()
