"""A dynamometer's logs of velocity, torque and a torque sensor, from the files to a report."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.recover.test_torque_sensors import BENCH, URDF, bench_log, without_positions
from wbc import load_robot
from wbc.cli import main
from wbc.measurement import save_log


def test_logs_without_positions_become_a_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bench.urdf").write_text(URDF)
    Path("robot.toml").write_text(BENCH)
    robot = load_robot("robot.toml")
    assert robot.name == tmp_path.name
    for k in (1, 2):
        save_log(without_positions(bench_log(robot, k)), f"run{k}.csv")
    logs = ["run1.csv", "run2.csv"]
    assert main(["init", "bench.urdf", *logs, "--out", "first"]) == 0
    assert load_robot("first/robot.toml").transmission.joints == ("test", "brake")
    assert main(["check", *logs, "--robot", "robot.toml"]) == 0
    assert "nothing to complain about" in capsys.readouterr().out
    assert main(["compare", *logs, "--robot", "robot.toml", "--report", "page.html"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "at test, where it is worst" in said
    assert Path("page.html").stat().st_size > 100_000
