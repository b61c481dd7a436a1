"""The mesh law against its statement: efficiency is power out over power in, a set at rest."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.errors import TransmissionError
from wbc.transmission import (
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


@pytest.mark.parametrize("torque", [3.0, -3.0, 0.0])
def test_the_interval_at_rest_ends_in_the_two_moving_branches(torque: float) -> None:
    low, high = mesh_input_interval(torque, ETA_F, ETA_B)
    moving = sorted(float(mesh_input(torque, v, ETA_F, ETA_B)) for v in (1.0, -1.0))
    np.testing.assert_allclose([low, high], moving)
    assert low <= mesh_input(torque, 0.0, ETA_F, ETA_B) <= high


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


def test_wedge_relation_and_its_range() -> None:
    np.testing.assert_allclose(wedge_backward_efficiency([1.0, 0.8, 0.7, 0.5]), [1, 0.75, 4 / 7, 0])
    for wrong in (0.0, -0.1, 1.01, np.nan):
        with pytest.raises(TransmissionError, match=r"\(0, 1\]"):
            wedge_backward_efficiency(wrong)
