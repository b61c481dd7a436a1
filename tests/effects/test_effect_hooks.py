"""Each effect against its definition, written out here once more, through inverse dynamics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wbc.arrays import FloatArray
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import (
    CoulombFriction,
    JointSpring,
    LoadFriction,
    PayloadMass,
    QuadraticDrag,
    RotorInertia,
    StribeckFriction,
    TorqueConstant,
    TorqueOffset,
    TorqueRipple,
    TransmissionEfficiency,
    ViscousFriction,
    load_robot,
)
from wbc.errors import EffectError
from wbc.robot import Effect, Motion, Robot

KNEE = 1
# One of each, at the knee (payload at the shin), far from its null value.
EXAMPLES: dict[str, Effect] = {
    "viscous_friction": ViscousFriction("knee", 0.4),
    "coulomb_friction": CoulombFriction("knee", 0.6),
    "stribeck_friction": StribeckFriction("knee", 0.5, 0.2),
    "load_friction": LoadFriction("knee", 0.15),
    "quadratic_drag": QuadraticDrag("knee", 0.3),
    "transmission_efficiency": TransmissionEfficiency("knee", 0.75, 0.5),
    "rotor_inertia": RotorInertia("knee", 0.08),
    "payload_mass": PayloadMass("shin", 0.9),
    "joint_spring": JointSpring("knee", 3.0, 0.25),
    "torque_constant": TorqueConstant("knee", 1.2),
    "torque_offset": TorqueOffset("knee", -0.7),
    "torque_ripple": TorqueRipple("knee", 0.4, 7.0, 0.3),
}


ADDING = (
    "viscous_friction",
    "coulomb_friction",
    "stribeck_friction",
    "quadratic_drag",
    "joint_spring",
    "torque_ripple",
    "torque_offset",
    "rotor_inertia",
)


@pytest.fixture
def robot() -> Robot:
    return load_robot("planar_leg_fixed").lossless()


@pytest.fixture
def motion() -> Motion:
    q, v, a = np.random.default_rng(7).normal(size=(3, 50, 2))
    return Motion(q, v, a)


def needed(robot: Robot, motion: Motion) -> FloatArray:
    """Return the torque (N, m) at the motor output that the drive reports."""
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    return torque * robot.transmission.gear_ratio


def added_at_the_knee(name: str, motion: Motion) -> FloatArray:
    """Return what an effect on a perfect gear adds to the knee's torque, from its definition."""
    q, v = motion.position[:, KNEE], motion.velocity[:, KNEE]
    assert motion.acceleration is not None
    return {
        "viscous_friction": 0.4 * v,
        "coulomb_friction": 0.6 * np.sign(v),
        "stribeck_friction": 0.5 * np.exp(-((v / 0.2) ** 2)) * np.sign(v),
        "quadratic_drag": 0.3 * v * np.abs(v),
        "joint_spring": 3.0 * (q - 0.25),
        "torque_ripple": -0.4 * np.sin(7.0 * q + 0.3),
        "torque_offset": np.full_like(v, 0.7),
        "rotor_inertia": (0.08 - 0.02666666666666667) * motion.acceleration[:, KNEE],
    }[name]


@pytest.mark.parametrize("name", ADDING)
def test_torque_that_an_effect_adds(name: str, robot: Robot, motion: Motion) -> None:
    more = needed(robot.with_effect(EXAMPLES[name]), motion) - needed(robot, motion)
    np.testing.assert_allclose(more[:, KNEE], added_at_the_knee(name, motion), atol=1e-12)
    np.testing.assert_allclose(more[:, 0], 0.0, atol=1e-12)


def test_losses_of_a_gear_depend_on_the_direction_of_power(robot: Robot, motion: Motion) -> None:
    output = link_torque(robot, motion)[:, KNEE]
    rotor = 0.02666666666666667 * motion.acceleration[:, KNEE]  # type: ignore[index]
    forward = output * motion.velocity[:, KNEE] > 0.0
    assert 0 < forward.sum() < len(forward)
    lossy = needed(robot.with_effect(EXAMPLES["transmission_efficiency"]), motion)[:, KNEE]
    np.testing.assert_allclose(
        lossy, np.where(forward, output / 0.75, output * 0.5) + rotor, atol=1e-12
    )
    loaded = needed(robot.with_effect(EXAMPLES["load_friction"]), motion)[:, KNEE]
    np.testing.assert_allclose(
        loaded, np.where(forward, output / 0.85, output / 1.15) + rotor, atol=1e-12
    )


def test_a_wrong_torque_constant_scales_what_is_reported(robot: Robot, motion: Motion) -> None:
    reported = needed(robot.with_effect(EXAMPLES["torque_constant"]), motion)
    np.testing.assert_allclose(reported * [1.0, 1.2], needed(robot, motion))
    effect = EXAMPLES["torque_constant"]
    torque = np.random.default_rng(1).normal(size=(5, 2))
    there = effect.drive(robot, motion, torque)
    np.testing.assert_allclose(there, torque * [1.0, 1.2])
    np.testing.assert_allclose(effect.drive_inverse(robot, motion, there), torque)


def test_the_offset_is_delivered_on_top_of_what_the_drive_scales(
    robot: Robot, motion: Motion
) -> None:
    both = robot.with_effects(EXAMPLES["torque_offset"], EXAMPLES["torque_constant"])
    np.testing.assert_allclose(
        1.2 * needed(both, motion)[:, KNEE] - 0.7, needed(robot, motion)[:, KNEE]
    )


def test_a_payload_is_a_point_mass_at_its_place(robot: Robot) -> None:
    still = Motion(np.array([[0.3, 0.5]]), np.zeros((1, 2)), np.zeros((1, 2)))
    base = link_torque(robot, still)[0]
    for where, arm in (("shin", 0.2), ("foot", 0.4)):
        loaded = robot.with_effect(PayloadMass(where, 0.9))
        more = link_torque(loaded, still)[0] - base
        # Gravity on a point `arm` along the shin; positive angles swing the leg to -x.
        knee = 0.9 * 9.81 * arm * np.sin(0.8)
        np.testing.assert_allclose(more, [knee + 0.9 * 9.81 * 0.4 * np.sin(0.3), knee])
    inertia = robot.with_effect(PayloadMass("foot", 0.9)).model.inertias[2]
    assert inertia.mass == pytest.approx(2.9)
    about_knee = inertia.inertia[1, 1] + inertia.mass * inertia.lever[2] ** 2
    assert about_knee == pytest.approx(2.0 * 0.4**2 / 3 + 0.9 * 0.4**2)


def test_effects_pile_up_in_order(motion: Motion, robot: Robot) -> None:
    many = robot.with_effects(*(EXAMPLES[n] for n in ("viscous_friction", "joint_spring")))
    more = needed(many, motion) - needed(robot, motion)
    expected = sum(added_at_the_knee(n, motion) for n in ("viscous_friction", "joint_spring"))
    np.testing.assert_allclose(more[:, KNEE], expected, atol=1e-12)
    twice = robot.with_effects(ViscousFriction("knee", 0.2), ViscousFriction("knee", 0.2))
    np.testing.assert_allclose(
        needed(twice, motion), needed(robot.with_effect(EXAMPLES["viscous_friction"]), motion)
    )


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: PayloadMass("shin", -2.0), EffectError, "leaves no mass"),
        (lambda: PayloadMass("shin", -2.5), EffectError, "the body has 2 kg"),
        (lambda: TransmissionEfficiency("knee", 0.9, 1.05), EffectError, "outside \\[-20, 1\\]"),
    ],
)
def test_effects_that_this_robot_cannot_have(make: Any, error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        load_robot("planar_leg").with_effect(make())
