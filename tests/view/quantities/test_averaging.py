"""Averages for pictures: noise goes, jumps and ramps stay."""

from __future__ import annotations

import numpy as np

from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.channels import gear_flow, jump_rows, rate_of_change, window_mean


def test_a_jump_stays_sharp_and_a_ramp_stays_a_ramp() -> None:
    ramp = np.arange(40.0)[:, None]
    signal = ramp + np.where(ramp < 17.0, 0.0, 100.0)
    np.testing.assert_allclose(window_mean(signal, 9, (17,)), signal, atol=1e-12)
    assert window_mean(signal, 9)[16, 0] > 30.0


def test_noise_falls_as_the_root_of_the_window() -> None:
    noise = np.random.default_rng(0).standard_normal(20_000)
    assert abs(float(np.std(window_mean(noise, 25))) - 0.2) < 0.02


def test_rates_do_not_see_the_jump() -> None:
    time = np.linspace(0.0, 1.0, 101)
    signal = (3.0 * time + np.where(time < 0.5, 0.0, 40.0))[:, None]
    jumps = jump_rows(signal, [48])
    assert jumps == (50,)
    np.testing.assert_allclose(rate_of_change(signal, time, jumps), 3.0, atol=1e-9)


def test_gear_speeds_jump_at_an_impact_of_a_log(leg: Robot, squat: Log) -> None:
    landing = int(np.argmax(squat.column("foot.force.z") > 0.0))
    moving = np.where(np.arange(len(squat)) < landing + 1, 0.0, 5.0)
    log = squat.with_columns({"knee.velocity": moving})
    speed = gear_flow(leg, log).speed[:, 1]
    np.testing.assert_allclose(speed, moving, atol=1e-12)
