"""Completion in the shell itself."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from wbc.cli import main


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("wbc dia", "diagnose"),
        ("wbc compare --loss", "--lossless"),
        ("wbc compare --robot planar_leg_f", "planar_leg_fixed"),
        ("wbc diagnose --add coul", "coulomb_friction"),
        ("wbc compare run_", "run_1.csv"),
    ],
)
def test_bash_completes(
    line: str, offered: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["completion", "bash"]) == 0
    (tmp_path / "wbc.sh").write_text(capsys.readouterr().out)
    (tmp_path / "run_1.csv").touch()
    words = line.split()
    typed = f"COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}"
    command = f'source wbc.sh; {typed}; _shtab_wbc; echo "${{COMPREPLY[@]}}"'
    shown = subprocess.run(["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True)
    assert offered in shown.stdout.split()
