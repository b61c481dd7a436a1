"""`wbc identify` on the sample logs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from wbc.cli import main
from wbc.measurement import save_log
from wbc.samples import sample_logs


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
