"""Servos, benches, columns and parameters: from files to an answer on the command line."""

import json
from pathlib import Path

import pytest

from tests.cli.conftest import LEG
from tests.conftest import Told
from tests.recover.test_torque_sensors import BENCH, URDF, bench_log, without_positions
from wbc import load_robot
from wbc.measurement import save_log
from wbc.samples import sample_paths


def test_logs_without_positions_become_a_report(here: Path, told: Told) -> None:
    Path("bench.urdf").write_text(URDF + "</robot>")
    Path("robot.toml").write_text(BENCH)
    assert load_robot("robot.toml").name == here.name
    for k in (1, 2):
        save_log(without_positions(bench_log(k)), f"run{k}.csv")
    logs = ["run1.csv", "run2.csv"]
    told("init", "bench.urdf", *logs, "--out", "first")
    assert load_robot("first/robot.toml").transmission.joints == ("test", "brake")
    assert "nothing to complain about" in told("check", *logs, "--robot", "robot.toml")
    said = told("compare", *logs, "--robot", "robot.toml", "--report", "page.html")
    assert "at test, where it is worst" in said
    assert Path("page.html").stat().st_size > 100_000


def test_parameters_are_printed_and_written(tmp_path: Path, told: Told) -> None:
    said = told("identify", *sample_paths(), *LEG, "--json", out := tmp_path / "parameters.json")
    friction = said.partition("coulomb_friction at hip")[2].split()
    found = {p["name"]: p for p in json.loads(out.read_text())["parameters"]}
    assert {"viscous_friction at knee", "torque_offset at knee", "mz shin"} <= found.keys()
    for value in (float(friction[0]), found["coulomb_friction at hip"]["value"]):
        assert value == pytest.approx(0.5, rel=0.02)
