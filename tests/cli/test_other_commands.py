"""Servos, benches, columns and parameters: from files to an answer on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.recover.test_torque_sensors import BENCH, URDF, bench_log, without_positions
from wbc import load_robot
from wbc.cli import main
from wbc.measurement import save_log
from wbc.samples import sample_logs


def test_logs_without_positions_become_a_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bench.urdf").write_text(URDF + "</robot>")
    Path("robot.toml").write_text(BENCH)
    robot = load_robot("robot.toml")
    assert robot.name == tmp_path.name
    for k in (1, 2):
        save_log(without_positions(bench_log(k)), f"run{k}.csv")
    logs = ["run1.csv", "run2.csv"]
    assert main(["init", "bench.urdf", *logs, "--out", "first"]) == 0
    assert load_robot("first/robot.toml").transmission.joints == ("test", "brake")
    assert main(["check", *logs, "--robot", "robot.toml"]) == 0
    assert "nothing to complain about" in capsys.readouterr().out
    assert main(["compare", *logs, "--robot", "robot.toml", "--report", "page.html"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "at test, where it is worst" in said
    assert Path("page.html").stat().st_size > 100_000


def test_it_prints_whole_numbers_within_eighty_columns_and_writes_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    logs = [str(save_log(log, tmp_path / f"run{k}.csv")) for k, log in enumerate(sample_logs())]
    out = tmp_path / "parameters.json"
    robot = ["--robot", "planar_leg_fixed", "--lossless"]
    assert main(["identify", *logs, *robot, "--json", str(out)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert max(map(len, shown)) <= 80
    (friction,) = (line for line in shown if line.strip().startswith("coulomb_friction at hip"))
    assert float(friction.split()[3]) == pytest.approx(0.5, rel=0.02)
    found = {p["name"]: p for p in json.loads(out.read_text())["parameters"]}
    assert found["coulomb_friction at hip"]["value"] == pytest.approx(0.5, rel=0.02)
