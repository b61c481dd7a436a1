"""Impacts are shorter than the samples: what the filters carry of them is set aside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc import load_robot
from wbc.identification.records.channels import read_channels
from wbc.identification.records.filters import Bandwidth
from wbc.identification.records.not_judged import away_from_impacts
from wbc.measurement import Log

LEG = load_robot("planar_leg")
BAND = Bandwidth(residual=10.0, kinematics=40.0)
RATE = 500.0


def _log(force: np.ndarray) -> Log:
    time = np.arange(len(force)) / RATE
    wave = np.sin(4.0 * time)
    columns = {f"{j}.position": 0.1 * wave for j in LEG.single_joints}
    columns |= {f"{j}.rotor_torque": 0.1 * wave for j in LEG.transmission.joints}
    columns |= {"foot.force.x": 0.0 * wave, "foot.force.y": 0.0 * wave, "foot.force.z": force}
    return Log(time, columns)


def test_the_samples_around_a_strike_are_set_aside() -> None:
    force = np.where(np.arange(2000) < 800, 0.0, 180.0)
    away = away_from_impacts(LEG, read_channels(LEG, _log(force)), BAND)
    reach = int(2.0 * RATE / BAND.kinematics)
    assert not away[800 - reach : 800 + reach].any()
    assert away.sum() == 2000 - 2 * reach


def test_a_foot_that_is_loaded_within_a_tenth_of_a_second_is_no_strike() -> None:
    force = 180.0 * np.clip((np.arange(2000) - 800) / 50.0, 0.0, 1.0)
    assert away_from_impacts(LEG, read_channels(LEG, _log(force)), BAND).all()


def test_half_of_a_log_stays_however_often_the_foot_strikes() -> None:
    force = np.where(np.arange(2000) // 20 % 2 == 0, 0.0, 180.0 + np.arange(2000) / 20.0)
    channels = read_channels(LEG, _log(force))
    away = away_from_impacts(LEG, channels, BAND)
    assert 0.45 < away.mean() < 0.55
    hard = replace(BAND, kinematics=400.0)  # shorter filters lose less
    assert away_from_impacts(LEG, channels, hard).mean() > away.mean()
