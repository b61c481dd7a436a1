"""Noise and wrong efficiencies: never worse than knowing nothing, beyond a stated margin."""

from __future__ import annotations

import numpy as np
import pytest

from sims.closed_loop_noise import MODELS, main

ROBOTS, NOISES, SEEDS = ("solo12", "anymal"), (0.0, 0.05), (0, 1, 2)
RUNS = [(noise, seed) for noise in NOISES for seed in (SEEDS if noise else SEEDS[:1])]
ERROR, TRAVEL = "rms error [mm]", "torque travel [limits/s]"


@pytest.fixture(scope="module")
def found():
    return main(0.4, NOISES, ROBOTS, SEEDS)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(("noise", "seed"), RUNS)
@pytest.mark.parametrize("believed", MODELS[:3])
def test_a_wrong_model_of_the_losses_is_better_than_none(found, robot, noise, seed, believed):
    """Tracking never worse; torque travel at most 5 % and 4 limits per second more."""
    knowing = found[robot, noise, believed, seed]
    nothing = found[robot, noise, "conservative", seed]
    assert knowing["refused ticks"] == 0
    assert knowing[ERROR] < nothing[ERROR]
    assert knowing[TRAVEL] < 1.05 * nothing[TRAVEL] + 4.0


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_right_model_tracks_through_noise(found, robot):
    errors = {
        kind: np.mean([found[robot, 0.05, kind, seed][ERROR] for seed in SEEDS])
        for kind in ("exact", "conservative")
    }
    assert errors["exact"] < 0.15 * errors["conservative"]
