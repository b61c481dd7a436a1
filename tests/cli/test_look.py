"""`wbc look` shows every column of a file that nobody has mapped yet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wbc.cli import main


def test_columns_are_grouped_and_gaps_jumps_and_restarts_are_marked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time = np.concatenate([np.arange(200) * 0.01, 3.0 + np.arange(100) * 0.01])
    angle = np.mod(40.0 * time, 360.0)
    rows = [
        f"{t:.3f};{a:.4f};7;{'on' if t < 1 else 'off'}" for t, a in zip(time, angle, strict=True)
    ]
    (tmp_path / "one.csv").write_text("stamp;q1;x;state\n" + "\n".join(rows) + "\n")
    (tmp_path / "two.csv").write_text("t,q\n" + "".join(f"{k % 60},{k}\n" for k in range(120)))
    files = [str(tmp_path / name) for name in ("one.csv", "two.csv")]
    page = tmp_path / "look.html"
    assert main(["look", *files, "--html", str(page)]) == 0
    assert "look.html" in capsys.readouterr().out
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


def test_a_file_without_a_header_is_looked_at_with_the_names_that_a_map_gives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run.csv").write_text("0 1\n1 2\n2 4\n")
    command = ["look", str(tmp_path / "run.csv"), "--html", str(tmp_path / "look.html")]
    assert main(command) == 2
    assert "rows.header" in capsys.readouterr().err
    (tmp_path / "map.toml").write_text('rows.header = ["time", "q"]')
    assert main([*command, "--columns", str(tmp_path / "map.toml")]) == 0
