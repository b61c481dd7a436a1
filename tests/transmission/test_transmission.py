from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wbc.errors import TransmissionError
from wbc.transmission import Transmission

PARALLELOGRAM = np.array([[1.0, 0.0], [-1.0, 1.0]])


def gears(**changes: Any) -> Transmission:
    values: dict[str, Any] = {
        "joints": ("hip", "knee"),
        "gear_ratio": [20.0, 10.0],
        "rotor_inertia": [1e-4, 2e-4],
        "forward_efficiency": [0.8, 0.7],
    }
    return Transmission(**{**values, **changes})


def test_the_backward_efficiency_follows_the_wedge_unless_given() -> None:
    np.testing.assert_allclose(gears().backward_efficiency, [0.75, 2 - 1 / 0.7])
    given = gears(backward_efficiency=[0.9, -0.2])
    np.testing.assert_array_equal(given.self_locking, [False, True])


def test_maps_of_a_parallelogram() -> None:
    legs = gears(topology=PARALLELOGRAM)
    rotor_speed = np.array([40.0, 30.0])
    joint_speed = legs.topology @ legs.reduction @ rotor_speed
    # The shin's absolute angle follows the second motor: q_hip + q_knee = psi_2.
    np.testing.assert_allclose(joint_speed, [2.0, 1.0])
    np.testing.assert_allclose(legs.motor_from_joint @ joint_speed, rotor_speed / [20.0, 10.0])
    torque = np.array([0.3, -0.7])
    # Duality: the same power on either side of perfect gears.
    assert joint_speed @ (legs.distribution @ torque) == pytest.approx(rotor_speed @ torque)
    np.testing.assert_allclose(legs.distribution, np.linalg.inv(PARALLELOGRAM @ legs.reduction).T)
    np.testing.assert_allclose(legs.reflected_inertia, [0.04, 0.02])


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("forward_efficiency", [0.8, 0.0], "forward_efficiency of joint 'knee' is 0"),
        ("forward_efficiency", [1.2, 0.5], "'hip' is 1.2; it must be <= 1"),
        ("backward_efficiency", [1.3, 0.5], "would create power"),
        # Less than 1/eta_f, and still more out than in while the joint drives.
        ("backward_efficiency", [1.1, 0.5], "'hip' is 1.1; it must be at most 1"),
        ("gear_ratio", [0.0, 1.0], "other than 0"),
        ("gear_ratio", [np.nan, 1.0], "finite"),
        ("gear_ratio", [1.0], r"shape \(1,\), expected \(2\)"),
        ("rotor_inertia", [-1.0, 0.0], ">= 0"),
        ("rotor_coulomb_friction", [0.0, -0.1], ">= 0"),
        ("rotor_viscous_friction", [0.0, -0.1], ">= 0"),
        ("torque_limit", [0.0, 1.0], "> 0"),
        ("torque_limit", [np.nan, 1.0], "> 0"),
        ("speed_limit", [-1.0, 1.0], "> 0"),
        ("stiffness", [-1.0, 1.0], "> 0"),
        ("damping", [-1.0, 1.0], ">= 0"),
        ("backlash", [-1.0, 1.0], ">= 0"),
        ("torque_constant", [0.0, 1.0], "NaN where unknown"),
        ("resistance", [-1.0, 1.0], "NaN where unknown"),
        ("topology", [[1.0, 1.0], [1.0, 1.0]], "singular"),
        ("topology", [[1.0]], "topology D has shape"),
        ("joints", ("hip", "hip"), "driven twice"),
        ("housings", ("base",), "1 housings for 2 motors"),
    ],
)
def test_numbers_outside_their_range_are_named(field: str, value: Any, message: str) -> None:
    with pytest.raises(TransmissionError, match=message):
        gears(**{field: value})


def test_arrays_are_read_only_and_unshared() -> None:
    ratio = np.array([20.0, 10.0])
    legs = gears(gear_ratio=ratio)
    ratio[0] = 1.0
    assert legs.gear_ratio[0] == 20.0
    for array in (legs.gear_ratio, legs.distribution, legs.motor_from_joint, legs.reduction):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_a_changed_copy_leaves_the_original_and_forgets_its_derived_matrices() -> None:
    legs = gears()
    assert legs.distribution[0, 0] == 20.0
    changed = legs.with_value("gear_ratio", "hip", 30.0)
    assert changed.distribution[0, 0] == 30.0
    assert legs.distribution[0, 0] == 20.0
    with pytest.raises(TransmissionError, match="Did you mean 'knee'"):
        legs.with_value("gear_ratio", "kne", 1.0)
