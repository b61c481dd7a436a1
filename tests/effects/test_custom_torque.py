"""Formulas against their definition, in files, in inverse dynamics, simulator and controller."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wbc.arrays import FloatArray
from wbc.control import Controller, PostureTask, Reference
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import (
    CoulombFriction,
    CustomTorque,
    QuadraticDrag,
    load_robot,
    save_robot,
)
from wbc.errors import EffectError, RobotError
from wbc.robot import Motion, Robot
from wbc.sim import Plane, Plant

FAR = Plane(height=-10.0)
FORMULA = {
    "1": 0.3,
    "q_hip^2": -0.4,
    "sin(2.5 q_knee) * v_hip": 0.2,
    "|v_knee| * v_knee": -0.1,
    "sign(v_knee)": -0.8,
    "cos(q_hip) * sign(v_knee)": 0.3,
    "sign(v_hip) * gravity_hip": 0.01,
}


@pytest.fixture
def robot() -> Robot:
    return load_robot("planar_leg_fixed").lossless()


@pytest.fixture
def motion() -> Motion:
    q, v, a = np.random.default_rng(3).normal(size=(3, 60, 2))
    return Motion(q, v, a)


def needed(robot: Robot, motion: Motion) -> FloatArray:
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    return torque * robot.transmission.gear_ratio


def gravity_of_the_hip(q: FloatArray) -> FloatArray:
    """Return the hip's gravity torque of two slender rods of 2 kg and 0.4 m."""
    thigh = 2.0 * 0.2 * np.sin(q[:, 0])
    return 9.81 * (thigh + 2.0 * (0.4 * np.sin(q[:, 0]) + 0.2 * np.sin(q.sum(axis=1))))


def test_a_formula_is_what_it_says(robot: Robot, motion: Motion) -> None:
    added = needed(robot.with_effect(CustomTorque.at("knee", FORMULA)), motion)
    (hip, knee), (v_hip, v_knee) = motion.position.T, motion.velocity.T
    smooth = (
        0.3
        - 0.4 * hip**2
        + 0.2 * np.sin(2.5 * knee) * v_hip
        - 0.1 * np.abs(v_knee) * v_knee
        + 0.01 * gravity_of_the_hip(motion.position) * v_hip / np.sqrt(v_hip**2 + 0.05**2)
    )
    level = np.maximum(0.8 - 0.3 * np.cos(hip), 0.0)
    more = added - needed(robot, motion)
    np.testing.assert_allclose(more[:, 1], -smooth + level * np.sign(v_knee), atol=1e-12)
    np.testing.assert_allclose(more[:, 0], 0.0, atol=1e-12)


def test_dry_terms_never_drive_the_joint(robot: Robot, motion: Motion) -> None:
    effect = CustomTorque.at("knee", {"sign(v_knee)": -0.2, "q_knee * sign(v_knee)": -0.5})
    level = effect.joint_friction(robot, motion)
    assert level is not None
    assert effect.joint_torque(robot, motion) is None
    np.testing.assert_allclose(
        level[:, 1], np.clip(0.2 + 0.5 * motion.position[:, 1], 0.0, None), atol=1e-15
    )
    assert (level[:, 1] == 0.0).any()


def test_it_is_the_named_effect_where_there_is_one(robot: Robot, motion: Motion) -> None:
    for formula, named in (
        ({"sign(v_knee)": -0.4}, CoulombFriction("knee", 0.4)),
        ({"|v_knee| * v_knee": -0.3}, QuadraticDrag("knee", 0.3)),
    ):
        custom = robot.with_effect(CustomTorque.at("knee", formula))
        expected = needed(robot.with_effect(named), motion)
        np.testing.assert_allclose(needed(custom, motion), expected, atol=1e-12)
        plants = [Plant(r, FAR) for r in (custom, robot.with_effect(named))]
        states = [p.state(robot.configuration(hip=0.4, knee=-0.9), [2.0, -1.0]) for p in plants]
        for _ in range(150):
            states = [
                p.step(s, np.array([0.02, -0.01]), 1e-3).state
                for p, s in zip(plants, states, strict=True)
            ]
        np.testing.assert_allclose(states[0].position, states[1].position, atol=1e-12)


def test_a_joint_with_dry_terms_comes_to_rest_and_stays(robot: Robot) -> None:
    formula = {"sign(v_knee)": -2.0, "|gravity_knee| * sign(v_knee)": -1.2}
    plant = Plant(robot.with_effect(CustomTorque.at("knee", formula)), FAR)
    state = plant.state(robot.configuration(hip=0.3, knee=0.8), [0.0, 2.0])
    for _ in range(400):
        state = plant.step(state, np.zeros(2), 1e-3).state
    assert abs(state.velocity[1]) < 1e-9
    rest = state.position[1]
    hips = []
    for _ in range(200):
        state = plant.step(state, np.zeros(2), 1e-3).state
        hips.append(state.velocity[0])
    assert abs(state.position[1] - rest) < 1e-7
    assert np.ptp(hips) > 0.05


def test_the_softened_sign_of_another_joint_does_not_chatter(robot: Robot) -> None:
    both = [
        CustomTorque.at("knee", {"sign(v_hip)": -0.5}),
        CustomTorque.at("hip", {"sign(v_knee)": -0.5, "v_hip": -1.0}),
    ]
    plant = Plant(robot.with_effects(*both), FAR)
    state = plant.state(robot.configuration(hip=0.2, knee=0.1), [0.5, -0.5])
    speeds = []
    for _ in range(800):
        state = plant.step(state, np.zeros(2), 1e-3).state
        speeds.append(state.velocity)
    signs = np.sign(np.array(speeds))
    assert np.count_nonzero(np.diff(signs, axis=0)) < 12


def test_the_controller_compensates_it(robot: Robot) -> None:
    formula = {"sin(q_hip) * |v_knee|": -0.5, "q_hip": -3.0, "|q_knee| * sign(v_knee)": -0.6}
    real = robot.with_effect(CustomTorque.at("knee", formula))
    errors = {}
    for name, believed in (("knows", real), ("ignores", robot)):
        posture = PostureTask.of(believed, stiffness=400.0)
        controller, plant = Controller(believed, [posture]), Plant(real, FAR)
        state = plant.state(robot.configuration(hip=0.4, knee=-0.8))
        worst = 0.0
        for k in range(600):
            t = 1e-3 * k
            wave = 0.3 * np.array([1.0, -1.0])
            start = np.array([0.4, -0.8])
            goal = Reference(
                start + wave * (1.0 - np.cos(4.0 * t)),
                wave * 4.0 * np.sin(4.0 * t),
                wave * 16.0 * np.cos(4.0 * t),
            )
            command = controller.step(state, {posture.name: goal})
            state = plant.step(state, command.rotor_torque, 1e-3).state
            worst = max(worst, abs(state.position[1] - goal.position[1]))
        errors[name] = worst
    assert errors["knows"] < 0.1 * errors["ignores"]


def test_it_is_saved_and_loaded_with_units(robot: Robot, tmp_path: Path) -> None:
    effect = CustomTorque.at("knee", FORMULA | {"v_hip * q_knee": 1.0 / 3.0})
    intervals = {("custom_torque", "knee", "1"): (0.2, 0.4)}
    path = save_robot(robot.with_effect(effect), tmp_path / "fitted.toml", intervals)
    again = load_robot(path)
    assert again.effects == (effect,)
    assert again.effects[0].values == effect.values
    text = path.read_text()
    assert '"v_hip * q_knee"' in text
    assert 'unit = "N m s/rad^2"' in text
    path.write_text(text.replace("N m s/rad^2", "N m s/rad"))
    with pytest.raises(RobotError, match=r"v_hip \* q_knee: unit 'N m s/rad' stands where"):
        load_robot(path)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "exp(q_hip)",
        "q_hip*v_hip",
        "q_hip *",
        "",
        "sign(q_hip)",
        "v_knee^0.5",
        "sin(q_hip) + 1",
    ],
)
def test_what_is_no_term_is_refused_with_the_grammar(text: str) -> None:
    with pytest.raises(EffectError, match="is no factor of a torque term: a term is '1' or"):
        CustomTorque.at("knee", {text: 1.0})


@pytest.mark.parametrize(
    ("where", "terms", "message"),
    [
        ("knee", {}, "needs at least one term"),
        ("knee", {"v_knee * sign(v_knee)": 1.0}, r"write v_knee \* sign\(v_knee\) as \|v_knee\|"),
        ("knee", {"sign(v_hip) * sign(v_hip)": 1.0}, "holds a sign twice"),
        ("knee", {"q_hip": np.nan}, "custom_torque at 'knee': q_hip = nan"),
        ("elbow", {"1": 1.0}, "Unknown place for custom_torque 'elbow'"),
        ("knee", {"v_hpi": 1.0}, "Unknown joint in 'v_hpi' at 'knee' 'hpi'. Did you mean 'hip'"),
    ],
)
def test_senseless_formulas_are_named(
    robot: Robot, where: str, terms: dict[str, float], message: str
) -> None:
    with pytest.raises(EffectError, match=message):
        robot.with_effect(CustomTorque.at(where, terms))


def test_the_load_of_a_leg_on_the_ground_is_no_function_of_its_motion() -> None:
    leg = load_robot("planar_leg")
    leg.with_effect(CustomTorque.at("knee", {"|gravity_knee| * sign(v_knee)": -0.1}))
    with pytest.raises(EffectError, match="depends on contact forces"):
        leg.with_effect(CustomTorque.at("knee", {"|load_knee| * sign(v_knee)": -0.1}))
