from __future__ import annotations

import numpy as np
import pytest

from tests.outside import outside
from wbc.measurement import (
    Log,
    find_duplicates,
    find_repeats,
    load_logs,
    residual_noise,
)


def _run(seed: int, *, phase: float = 0.0, offset: float = 0.0, level: float = 2e-4) -> Log:
    rng = np.random.default_rng(seed)
    time = np.arange(1500) * 0.002 + offset
    t = time - offset
    position = np.sin(3.0 * t + phase) + 0.5 * np.sin(7.0 * t)
    return Log(
        time,
        {
            "hip.position": position + level * rng.normal(size=t.size),
            "knee.position": 0.2 + level * rng.normal(size=t.size),
            "hip.motor_torque": 4.0 * position + 0.05 * rng.normal(size=t.size),
        },
    )


def test_repeats_are_found_and_copies_and_other_runs_are_not() -> None:
    logs = [_run(0), _run(1, phase=1.0), _run(2, offset=11.0), _run(3, phase=0.01), _run(0)]
    assert find_repeats(logs) == ((0, 2, 3),)
    assert find_duplicates(logs) == ((0, 4),)
    assert find_repeats([logs[0], logs[4]]) == ()
    assert find_repeats([logs[0], logs[2][:1000]]) == ()


def test_residual_noise_ignores_motion_and_single_steps() -> None:
    rng = np.random.default_rng(5)
    time = np.arange(4000) * 0.002 + rng.uniform(-5e-4, 5e-4, 4000)
    smooth = 3.0 * np.sin(8.0 * time)
    assert residual_noise(time, smooth) < 1e-5
    noisy = smooth + 0.01 * rng.normal(size=time.size)
    assert residual_noise(time, noisy) == pytest.approx(0.01, rel=0.08)
    stepped = noisy + 5.0 * (time > 4.0)
    assert residual_noise(time, stepped) == pytest.approx(0.01, rel=0.08)


@pytest.mark.parametrize("case", ["case00", "case02", "case09", "case10"])
def test_the_practice_leg_repeats_a_by_b_and_shows_its_stated_noise(case: str) -> None:
    logs = load_logs([outside(f"practice_leg/{case}{letter}.csv") for letter in "abcd"])
    assert find_repeats(logs) == ((0, 1),)
    # README: position 2e-5 rad and 18-bit quantisation, velocity 3e-3 rad/s, rotor torque 2e-3 N m.
    stated = {"position": (2.1e-5, 0.1), "velocity": (3e-3, 0.05), "rotor_torque": (2e-3, 0.1)}
    for name in (f"{joint}.{quantity}" for joint in ("hip", "knee") for quantity in stated):
        level, share = stated[name.partition(".")[2]]
        assert residual_noise(logs[0].time, logs[0].column(name)) == pytest.approx(level, rel=share)
