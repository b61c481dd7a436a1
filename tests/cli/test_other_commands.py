"""Servos, benches, columns and parameters: from files to an answer on the command line."""

import json
import re
from pathlib import Path

import numpy as np
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


def test_columns_are_grouped_and_gaps_jumps_and_restarts_are_marked(
    tmp_path: Path, told: Told
) -> None:
    time = np.concatenate([np.arange(200) * 0.01, 3.0 + np.arange(100) * 0.01])
    angle = np.mod(40.0 * time, 360.0)
    rows = [
        f"{t:.3f};{a:.4f};7;{'on' if t < 1 else 'off'}" for t, a in zip(time, angle, strict=True)
    ]
    (tmp_path / "one.csv").write_text("stamp;q1;x;state\n" + "\n".join(rows) + "\n")
    (tmp_path / "two.csv").write_text("t,q\n" + "".join(f"{k % 60},{k}\n" for k in range(120)))
    files, page = [tmp_path / name for name in ("one.csv", "two.csv")], tmp_path / "look.html"
    assert "look.html" in told("look", *files, "--html", page)
    text = page.read_text()
    first, second = text.split("<h1>")[1:]
    headings = [part.partition("</h2>")[0] for part in first.split("<h2>")[1:]]
    assert headings == ["time", "position", "constant", "text"]
    assert "samples are missing in 1 places" in first
    assert first.count("class='gap'") == 3  # in each column of numbers
    assert "7 throughout" in first
    assert "2 values: on, off" in first
    assert "2 runs: the clock starts again" in second
    assert "class='again'" in second
    assert "http" not in text.replace("http://www.w3.org", "")
    # Pictures take the width that there is (a phone's), colours those of a dark page.
    assert "name='viewport'" in text
    assert not re.search(r"<svg[^>]* width=", text)
    assert "prefers-color-scheme: dark" in text


def test_a_file_without_a_header_is_looked_at_with_the_names_that_a_map_gives(
    tmp_path: Path, told: Told
) -> None:
    (tmp_path / "run.csv").write_text("0 1\n1 2\n2 4\n")
    command = ["look", tmp_path / "run.csv", "--html", tmp_path / "look.html"]
    assert "rows.header" in told(*command, code=2)
    (tmp_path / "map.toml").write_text('rows.header = ["time", "q"]')
    told(*command, "--columns", tmp_path / "map.toml")


def test_parameters_are_printed_and_written(tmp_path: Path, told: Told) -> None:
    said = told("identify", *sample_paths(), *LEG, "--json", out := tmp_path / "parameters.json")
    friction = said.partition("coulomb_friction at hip")[2].split()
    found = {p["name"]: p for p in json.loads(out.read_text())["parameters"]}
    assert {"viscous_friction at knee", "torque_offset at knee", "mz shin"} <= found.keys()
    for value in (float(friction[0]), found["coulomb_friction at hip"]["value"]):
        assert value == pytest.approx(0.5, rel=0.02)
