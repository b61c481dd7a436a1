"""Logs and studies go to other processes unchanged and as read-only as before."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from wbc.design import Study, parse_sweep
from wbc.effects import load_robot
from wbc.measurement import Log, load_log, save_log


def test_a_log_travels_with_its_source(tmp_path: Path) -> None:
    time = np.linspace(0.0, 1.0, 20)
    log = load_log(save_log(Log(time, {"knee.position": np.sin(time)}), tmp_path / "a.csv"))
    copy = pickle.loads(pickle.dumps(log))
    np.testing.assert_array_equal(copy.time, log.time)
    np.testing.assert_array_equal(copy.column("knee.position"), log.column("knee.position"))
    assert copy.source == log.source
    with pytest.raises(ValueError, match="read-only"):
        copy.time[0] = 1.0
    with pytest.raises(TypeError, match="assignment"):
        copy.columns["hip.position"] = log.time


def test_a_study_travels_and_evaluates_the_same() -> None:
    leg = load_robot("planar_leg")
    study = Study("planar_leg", (parse_sweep("reduction=6:60:4"),), "foot",
                  tuple(leg.pose("paper").tolist()))  # fmt: skip
    copy = pickle.loads(pickle.dumps(study))
    assert copy == study
    for name, values in study.evaluate(0, 4).items():
        np.testing.assert_array_equal(copy.evaluate(0, 4)[name], values)
