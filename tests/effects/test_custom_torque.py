"""Formulas against their definition, at rest in the plant, and in files."""

from pathlib import Path

import numpy as np
import pytest

from tests.effects.needed import motion_of, needed
from wbc.arrays import FloatArray
from wbc.effects import CustomTorque, load_robot, save_robot
from wbc.errors import EffectError, RobotError
from wbc.robot import Motion, Robot
from wbc.sim import Plane, Plant, simulate

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
def motion(leg: Robot) -> Motion:
    return motion_of(leg)


def gravity_of_the_hip(q: FloatArray) -> FloatArray:
    """Return the hip's gravity torque of two slender rods of 2 kg and 0.4 m."""
    thigh = 2.0 * 0.2 * np.sin(q[:, 0])
    return 9.81 * (thigh + 2.0 * (0.4 * np.sin(q[:, 0]) + 0.2 * np.sin(q.sum(axis=1))))


def test_a_formula_is_what_it_says(leg: Robot, motion: Motion) -> None:
    added = needed(leg.with_effect(CustomTorque.at("knee", FORMULA)), motion)
    (hip, knee), (v_hip, v_knee) = motion.position.T, motion.velocity.T
    smooth = 0.3 - 0.4 * hip**2 + 0.2 * np.sin(2.5 * knee) * v_hip - 0.1 * np.abs(v_knee) * v_knee
    soft_sign = v_hip / np.sqrt(v_hip**2 + 0.05**2)
    smooth += 0.01 * gravity_of_the_hip(motion.position) * soft_sign
    level = np.maximum(0.8 - 0.3 * np.cos(hip), 0.0)
    more = added - needed(leg, motion)
    np.testing.assert_allclose(more[:, 1], -smooth + level * np.sign(v_knee), atol=1e-12)
    np.testing.assert_allclose(more[:, 0], 0.0, atol=1e-12)


def test_dry_terms_never_drive_the_joint(leg: Robot, motion: Motion) -> None:
    effect = CustomTorque.at("knee", {"sign(v_knee)": -0.2, "q_knee * sign(v_knee)": -0.5})
    level = effect.joint_friction(leg, motion)
    assert level is not None
    assert effect.joint_torque(leg, motion) is None
    known = np.maximum(0.2 + 0.5 * motion.position[:, 1], 0.0)
    np.testing.assert_allclose(level[:, 1], known, atol=1e-15)
    assert (level[:, 1] == 0.0).any()


def test_a_joint_with_dry_terms_comes_to_rest_and_stays(leg: Robot) -> None:
    formula = {"sign(v_knee)": -2.0, "|gravity_knee| * sign(v_knee)": -1.2}
    plant = Plant(leg.with_effect(CustomTorque.at("knee", formula)), FAR)
    state = plant.state(leg.configuration(hip=0.3, knee=0.8), [0.0, 2.0])
    state = plant.run(state, np.zeros(2), 0.4, 400)[-1].state
    assert abs(state.velocity[1]) < 1e-9
    log = simulate(plant, lambda s: np.zeros(2), state, 0.2).log
    assert np.abs(log.column("knee.position") - state.position[1]).max() < 1e-7
    assert np.ptp(log.column("hip.velocity")) > 0.05


def test_the_softened_sign_of_another_joint_does_not_chatter(leg: Robot) -> None:
    knee = CustomTorque.at("knee", {"sign(v_hip)": -0.5})
    hip = CustomTorque.at("hip", {"sign(v_knee)": -0.5, "v_hip": -1.0})
    plant = Plant(leg.with_effects(knee, hip), FAR)
    state = plant.state(leg.configuration(hip=0.2, knee=0.1), [0.5, -0.5])
    log = simulate(plant, lambda s: np.zeros(2), state, 0.8).log
    speeds = np.array([log.column(f"{joint}.velocity") for joint in leg.joints])
    assert np.count_nonzero(np.diff(np.sign(speeds))) < 12


def test_it_is_saved_and_loaded_with_units(leg: Robot, tmp_path: Path) -> None:
    effect = CustomTorque.at("knee", FORMULA | {"v_hip * q_knee": 1.0 / 3.0})
    intervals = {("custom_torque", "knee", "1"): (0.2, 0.4)}
    path = save_robot(leg.with_effect(effect), tmp_path / "fitted.toml", intervals)
    (again,) = load_robot(path).effects
    assert (again, again.values) == (effect, effect.values)
    text = path.read_text()
    assert '"v_hip * q_knee"' in text
    assert 'unit = "N m s/rad^2"' in text
    path.write_text(text.replace("N m s/rad^2", "N m s/rad"))
    with pytest.raises(RobotError, match=r"v_hip \* q_knee: unit 'N m s/rad' stands where"):
        load_robot(path)


GRAMMAR = "is no factor of a torque term: a term is '1' or"
WRONG = (
    "__import__('os').system('true')",
    "exp(q_hip)",
    "q_hip*v_hip",
    "q_hip *",
    "",
    "v_knee^0.5",
)


@pytest.mark.parametrize(
    ("where", "terms", "message"),
    [
        *[("knee", {text: 1.0}, GRAMMAR) for text in (*WRONG, "sign(q_hip)", "sin(q_hip) + 1")],
        ("knee", {}, "needs at least one term"),
        ("knee", {"v_knee * sign(v_knee)": 1.0}, r"write v_knee \* sign\(v_knee\) as \|v_knee\|"),
        ("knee", {"sign(v_hip) * sign(v_hip)": 1.0}, "holds a sign twice"),
        ("knee", {"q_hip": np.nan}, "custom_torque at 'knee': q_hip = nan"),
        ("elbow", {"1": 1.0}, "Unknown place for custom_torque 'elbow'"),
        ("knee", {"v_hpi": 1.0}, "Unknown joint in 'v_hpi' at 'knee' 'hpi'. Did you mean 'hip'"),
    ],
)
def test_senseless_formulas_are_named(
    leg: Robot, where: str, terms: dict[str, float], message: str
) -> None:
    with pytest.raises(EffectError, match=message):
        leg.with_effect(CustomTorque.at(where, terms))


def test_the_load_of_a_leg_on_the_ground_is_no_function_of_its_motion() -> None:
    leg = load_robot("planar_leg")
    leg.with_effect(CustomTorque.at("knee", {"|gravity_knee| * sign(v_knee)": -0.1}))
    with pytest.raises(EffectError, match="depends on contact forces"):
        leg.with_effect(CustomTorque.at("knee", {"|load_knee| * sign(v_knee)": -0.1}))
