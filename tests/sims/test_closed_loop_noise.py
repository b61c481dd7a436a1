"""Noise and wrong efficiencies: never worse than knowing nothing, beyond a stated margin."""

from __future__ import annotations

import pytest

from sims.closed_loop_noise import MODELS, main

NOISES = (0.0, 0.05)
ERROR, TRAVEL = "rms error [mm]", "torque travel [limits/s]"


@pytest.fixture(scope="module")
def found():
    return main(0.6, NOISES)


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("believed", MODELS[:3])
def test_a_wrong_model_of_the_losses_is_better_than_none(found, noise, believed):
    """Tracking never worse; torque travel at most 5 % and 4 limits per second more."""
    knowing, nothing = found[noise, believed], found[noise, "conservative"]
    assert knowing["refused ticks"] == 0
    assert knowing[ERROR] < nothing[ERROR]
    assert knowing[TRAVEL] < 1.05 * nothing[TRAVEL] + 4.0


def test_the_right_model_tracks_through_noise(found):
    assert found[0.05, "exact"][ERROR] < 0.15 * found[0.05, "conservative"][ERROR]
