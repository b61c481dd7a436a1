"""Robots, effects, logs and studies travel between processes unchanged."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from wbc.design import Study, parse_sweep
from wbc.dynamics import evaluate
from wbc.effects import EFFECTS, load_robot
from wbc.measurement import Log, load_log, save_log


@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg", "solo12", "staubli_tx40"])
def test_a_robot_is_the_same_after_a_journey(name: str) -> None:
    robot = load_robot(name)
    kinds = ("viscous_friction", "rotor_inertia", "actuation_delay")
    joint = robot.transmission.joints[0]
    effects = [EFFECTS[k].at(joint, EFFECTS[k].null_values(robot, joint)) for k in kinds]
    robot = robot.with_effects(*effects)
    copy = pickle.loads(pickle.dumps(robot))
    assert copy.effects == robot.effects
    assert copy.name == robot.name
    assert copy.poses.keys() == robot.poses.keys()
    for array in (copy.transmission.gear_ratio, *copy.poses.values()):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    rest, q = np.zeros(robot.model.nv), robot.neutral()
    one, other = (evaluate(r, q, rest + 0.1) for r in (robot, copy))
    np.testing.assert_array_equal(one.mass_matrix, other.mass_matrix)
    np.testing.assert_array_equal(one.bias, other.bias)
    np.testing.assert_array_equal(copy.transmission.gear_ratio, robot.transmission.gear_ratio)


def test_every_effect_travels() -> None:
    robot = load_robot("planar_leg")
    for kind in EFFECTS.values():
        for where in kind.places(robot)[:1]:
            effect = kind.at(where, kind.null_values(robot, where))
            assert pickle.loads(pickle.dumps(effect)) == effect


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
