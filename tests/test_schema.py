"""Files say which version of their format they have: older ones are read, newer ones refused."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Told
from wbc import load_robot, save_robot
from wbc.design.experiment import tied_rivals
from wbc.effects import CoulombFriction
from wbc.errors import DesignError, LogError, RobotError
from wbc.files import SCHEMA
from wbc.measurement import load_log, write_map
from wbc.samples import sample_paths

OLD = """
robot = "planar_leg_fixed"
lossless = true
[[effects]]
effect = "coulomb_friction"
where = "hip"
[effects.parameters.level]
value = 0.5
unit = "N m"
"""


# What `wbc diagnose --json` of 0.1 wrote for the sample logs, shortened.
LOSSES = {"forward_efficiency": 0.8, "backward_efficiency": 0.75}
GEAR = {
    "effect": "transmission_efficiency",
    "where": ["knee"],
    "parameters": {name: {"value": value, "unit": "1"} for name, value in LOSSES.items()},
}
RIVAL = {"effect": "load_friction", "where": "knee", "parameters": {"coefficient": 0.219}}
ROW = {
    "added": [{"effect": "load_friction", "where": "knee"}],
    "removed": [{"effect": "transmission_efficiency", "where": "knee"}],
}
ROW |= {"standing": "worse", "effects": [RIVAL], "covariance": None}
ANSWER = {"verdict": "named", "effects": [{**GEAR, "alternatives": []}], "ranking": [ROW]}


def test_a_saved_robot_holds_its_version_an_older_is_read_and_a_newer_refused(
    tmp_path: Path,
) -> None:
    robot = load_robot("planar_leg_fixed").with_effect(CoulombFriction("hip", 0.5))
    (tmp_path / "old.toml").write_text(OLD)
    assert load_robot(tmp_path / "old.toml").effects == robot.effects
    path = save_robot(robot, tmp_path / "new.toml")
    assert tomllib.loads(path.read_text())["schema"] == SCHEMA
    assert load_robot(path).effects == robot.effects
    path.write_text(path.read_text().replace(f"schema = {SCHEMA}", "schema = 99"))
    with pytest.raises(RobotError, match=rf"newer wbc.*write schema = {SCHEMA} to read it"):
        load_robot(path)
    path.write_text(path.read_text().replace("schema = 99", f"schema = {SCHEMA}"))
    assert load_robot(path).effects == robot.effects  # the way out that the message names
    path.write_text(OLD.replace("robot =", 'schema = "new"\nrobot =', 1))
    with pytest.raises(RobotError, match="remove the line"):
        load_robot(path)


def test_a_column_map_holds_its_version_and_an_older_one_has_none(tmp_path: Path) -> None:
    path = write_map(tmp_path / "map.toml", {"time": {"unit": "s"}})
    assert tomllib.loads(path.read_text())["schema"] == SCHEMA
    expected = load_log(sample_paths()[0])
    for text in (path.read_text(), '[time]\nunit = "s"\n'):
        path.write_text(text)
        assert len(load_log(sample_paths()[0], path)) == len(expected)
    path.write_text("schema = 99\n")
    with pytest.raises(LogError, match="newer wbc"):
        load_log(sample_paths()[0], path)


def test_a_diagnosis_of_0_1_is_read_and_a_newer_one_is_refused(tmp_path: Path, told: Told) -> None:
    assert json.loads(told("list", "effects", "--json", "-"))["schema"] == SCHEMA
    robot, path = load_robot("planar_leg_fixed").lossless(), tmp_path / "found.json"
    path.write_text(json.dumps(ANSWER))
    causes = tied_rivals(path, robot, np.full(2, 0.1)).causes
    assert [effect.name for (effect,) in causes] == ["transmission_efficiency", "load_friction"]
    path.write_text(json.dumps({"schema": 99, **ANSWER}))
    with pytest.raises(DesignError, match=rf"newer wbc.*write schema = {SCHEMA} to read it"):
        tied_rivals(path, robot, np.full(2, 0.1))
