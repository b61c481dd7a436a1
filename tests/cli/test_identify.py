"""`wbc identify` on the sample logs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from wbc.cli import main
from wbc.cli.printout import table
from wbc.identification.classic import ClassicFit
from wbc.identification.classic.classic_fit import BaseParameter
from wbc.measurement import save_log
from wbc.samples import sample_logs
from wbc.view.rows import parameter_rows


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


def test_a_long_name_breaks_and_its_numbers_stay(capsys: pytest.CaptureFixture[str]) -> None:
    name = "rotor_viscous_friction at a_joint_with_a_name_that_fills_a_screen"
    sums = " ".join(["+0.312 m another_link_with_a_long_name"] * 3)
    parameter = BaseParameter(name, sums, 1234.5, -0.000283, 1234.1, 1234.9, "N m s/rad")
    nothing = np.zeros((0,))
    fit = ClassicFit((parameter,), (), nothing, nothing, nothing, ())
    Console(width=60).print(table(parameter_rows(fit)))
    shown = capsys.readouterr().out
    assert all(text in shown for text in ("1234", "1234 … 1235", "−0.000283", "N m s/rad"))
