from __future__ import annotations

import numpy as np
import pytest

from tests.measurement.conftest import outside
from wbc.errors import LogError
from wbc.measurement import (
    Log,
    find_duplicates,
    find_repeats,
    load_logs,
    noise_floor,
    repeat_deviation,
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


def test_noise_comes_from_repeats_or_is_called_a_lower_bound() -> None:
    floor = noise_floor([_run(0), _run(2), _run(1, phase=1.0)])
    assert floor.groups == ((0, 1),)
    assert not floor.is_lower_bound
    assert floor.level["hip.position"] == pytest.approx(2e-4, rel=0.1)
    assert floor.level["hip.motor_torque"] == pytest.approx(0.05, rel=0.1)
    alone = noise_floor([_run(0)])
    assert alone.is_lower_bound
    assert "lower bound" in alone.label
    assert alone.level["hip.position"] == pytest.approx(2e-4, rel=0.1)
    with pytest.raises(LogError, match="There are: 0"):
        noise_floor([_run(0)], [(0, 1)])
    with pytest.raises(LogError, match="no logs"):
        noise_floor([])


def test_the_deviation_of_repeats_is_unbiased_for_any_number_of_them() -> None:
    rng = np.random.default_rng(4)
    signal = np.sin(np.arange(20_000) * 0.01)
    for count in (2, 3, 5):
        series = [signal + 0.3 * rng.normal(size=signal.size) for _ in range(count)]
        assert repeat_deviation(series) == pytest.approx(0.3, rel=0.03)
    with pytest.raises(LogError, match="two or more"):
        repeat_deviation([signal])


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
    floor = noise_floor(logs)
    assert floor.groups == ((0, 1),)
    # README: position 2e-5 rad and 18-bit quantisation, velocity 3e-3 rad/s, rotor torque 2e-3 N m.
    for joint in ("hip", "knee"):
        assert floor.level[f"{joint}.position"] == pytest.approx(2.1e-5, rel=0.1)
        assert floor.level[f"{joint}.velocity"] == pytest.approx(3e-3, rel=0.05)
        assert floor.level[f"{joint}.rotor_torque"] == pytest.approx(2e-3, rel=0.1)
