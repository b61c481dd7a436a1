"""The mesh law against its statement: efficiency is power out over power in, a set at rest."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.errors import TransmissionError
from wbc.transmission import (
    direction,
    efficiency,
    mesh_input,
    mesh_input_interval,
    mesh_output,
    wedge_backward_efficiency,
)

ETA_F, ETA_B = 0.8, 0.6


@pytest.mark.parametrize("speed", [2.0, -2.0])
@pytest.mark.parametrize("torque", [3.0, -3.0])
def test_power_out_is_efficiency_times_power_in(torque: float, speed: float) -> None:
    given = float(mesh_input(torque, speed, ETA_F, ETA_B))
    if torque * speed > 0:
        assert torque * speed == pytest.approx(ETA_F * given * speed)
    else:
        assert -given * speed == pytest.approx(ETA_B * -torque * speed)


def test_a_gear_that_drives_better_backward_than_forward_is_allowed() -> None:
    assert mesh_input(1.0, 1.0, 0.7, 0.9) == pytest.approx(1 / 0.7)
    assert mesh_output(mesh_input(-1.0, 1.0, 0.7, 0.9), 1.0, 0.7, 0.9) == pytest.approx(-1.0)


@pytest.mark.parametrize("torque", [3.0, -3.0, 0.0])
def test_the_interval_at_rest_ends_in_the_two_moving_branches(torque: float) -> None:
    low, high = mesh_input_interval(torque, ETA_F, ETA_B)
    moving = sorted(float(mesh_input(torque, v, ETA_F, ETA_B)) for v in (1.0, -1.0))
    np.testing.assert_allclose([low, high], moving)
    assert low <= mesh_input(torque, 0.0, ETA_F, ETA_B) <= high


def test_at_rest_and_carrying_the_interval_is_the_one_of_the_design() -> None:
    low, high = mesh_input_interval(2.0, ETA_F, ETA_B)
    assert (low, high) == (pytest.approx(ETA_B * 2.0), pytest.approx(2.0 / ETA_F))


def test_the_output_between_the_branches_at_rest() -> None:
    ends = (ETA_F * 2.0, 2.0 / ETA_B)
    assert mesh_output(2.0, 0.0, ETA_F, ETA_B) == pytest.approx(np.mean(ends))
    assert mesh_input(2.0, 0.0, ETA_F, ETA_B) == pytest.approx(np.mean((2.0 / ETA_F, 2.0 * ETA_B)))


def test_a_self_locking_gear_needs_help_to_be_lowered() -> None:
    # T pulls along the motion, the motor must push the same way: t and v have one sign.
    given = mesh_input(-2.0, 1.0, 0.45, float(wedge_backward_efficiency(0.45)))
    assert given > 0.0
    low, high = mesh_input_interval(2.0, 0.45, -0.2)
    assert low < 0.0 < high
    for locking in (-0.2, 0.0):
        with pytest.raises(TransmissionError, match="self-locking"):
            mesh_output(-1.0, 1.0, 0.45, locking)
        assert mesh_output(1.0, 1.0, 0.45, locking) == pytest.approx(0.45)


def test_gears_are_evaluated_side_by_side() -> None:
    torque = np.array([[1.0, -1.0], [2.0, 2.0]])
    speed = np.array([[1.0, 1.0], [-1.0, 0.5]])
    eta_f, eta_b = np.array([0.8, 0.5]), np.array([0.7, 0.2])
    together = mesh_input(torque, speed, eta_f, eta_b)
    for row, column in np.ndindex(2, 2):
        alone = mesh_input(torque[row, column], speed[row, column], eta_f[column], eta_b[column])
        assert together[row, column] == alone
    np.testing.assert_allclose(mesh_output(together, speed, eta_f, eta_b), torque)


def test_wedge_relation_and_its_range() -> None:
    np.testing.assert_allclose(wedge_backward_efficiency([1.0, 0.8, 0.7, 0.5]), [1, 0.75, 4 / 7, 0])
    for wrong in (0.0, -0.1, 1.01, np.nan):
        with pytest.raises(TransmissionError, match=r"\(0, 1\]"):
            wedge_backward_efficiency(wrong)


def test_direction_and_its_deadband() -> None:
    np.testing.assert_array_equal(direction([2.0, -2.0, 0.0]), [1.0, -1.0, 0.0])
    np.testing.assert_array_equal(direction([0.5, -0.5, 2.0], deadband=1.0), [0.0, 0.0, 1.0])


def test_efficiency_matrix_diagonal() -> None:
    np.testing.assert_allclose(
        efficiency([1, -1, 0], [0.8, 0.8, 0.8], [0.5, 0.5, 0.5]), [0.8, 2.0, 1.0]
    )
    with pytest.raises(TransmissionError, match="never driven backward"):
        efficiency([-1, 1], [0.5, 0.5], [0.0, 0.0])
