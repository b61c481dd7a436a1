"""Averages for pictures: noise goes, jumps and ramps stay."""

from __future__ import annotations

import numpy as np

from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.channels import gear_flow, window_mean


def test_a_jump_stays_sharp_and_a_ramp_stays_a_ramp() -> None:
    ramp = np.arange(40.0)[:, None]
    signal = ramp + np.where(ramp < 17.0, 0.0, 100.0)
    np.testing.assert_allclose(window_mean(signal, 9, (17,)), signal, atol=1e-12)
    assert window_mean(signal, 9)[16, 0] > 30.0


def test_gear_speeds_jump_at_an_impact_of_a_log(leg: Robot, squat: Log) -> None:
    landing = int(np.argmax(squat.column("foot.force.z") > 0.0))
    moving = np.where(np.arange(len(squat)) < landing + 1, 0.0, 5.0)
    log = squat.with_columns({"knee.velocity": moving})
    speed = gear_flow(leg, log).speed[:, 1]
    np.testing.assert_allclose(speed, moving, atol=1e-12)
