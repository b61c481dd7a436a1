"""Completion in the shells themselves, where they are installed."""

from __future__ import annotations

import os
import pty
import select
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from wbc.cli import main

QUESTIONS = [
    ("wbc dia", "diagnose"),
    ("wbc compare --loss", "--lossless"),
    ("wbc compare --robot planar_leg_f", "planar_leg_fixed"),
    ("wbc diagnose --add coul", "coulomb_friction"),
    ("wbc compare run_", "run_1.csv"),
]
PATIENCE = 30.0


def shell(name: str) -> str:
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not installed (Debian: apt-get install {name})")
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "run_1.csv").touch()
    command = tmp_path / "bin" / "wbc"
    command.parent.mkdir()
    command.write_text("#!/bin/sh\n")
    command.chmod(0o755)
    return tmp_path


def script(name: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["completion", name]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(("line", "offered"), QUESTIONS)
def test_bash_completes(
    line: str, offered: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bash = shell("bash")
    (folder / "wbc.sh").write_text(script("bash", capsys))
    words = line.split()
    typed = f"COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}"
    command = f'source wbc.sh; {typed}; _shtab_wbc; echo "${{COMPREPLY[@]}}"'
    shown = subprocess.run([bash, "-c", command], cwd=folder, capture_output=True, text=True)
    assert offered in shown.stdout.split()


@pytest.mark.parametrize(("line", "offered"), QUESTIONS)
def test_fish_completes(
    line: str, offered: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fish = shell("fish")
    (folder / "wbc.fish").write_text(script("fish", capsys))
    command = [fish, "--no-config", "-c", f"source wbc.fish; complete -C '{line}'"]
    places = {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "HOME": str(folder)}
    shown = subprocess.run(
        command, cwd=folder, env={**os.environ, **places}, capture_output=True, text=True
    )
    assert offered in [answer.split("\t")[0] for answer in shown.stdout.splitlines()]


def test_zsh_completes_what_is_typed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    zsh = shell("zsh")
    (folder / "_wbc").write_text(script("zsh", capsys))
    child, terminal = pty.fork()
    if child == 0:
        places = {"HOME": str(folder), "PATH": f"{folder / 'bin'}:{os.environ['PATH']}"}
        os.chdir(folder)
        os.execve(zsh, [zsh, "-f", "-i"], {**os.environ, **places, "TERM": "dumb"})
    try:
        setup = (
            "fpath=($PWD $fpath); autoload -Uz compinit; compinit -u -D; PS1='> '; echo INI''T\n"
        )
        os.write(terminal, setup.encode())
        assert b"INIT" in answer(terminal, b"INIT")
        for line, offered in QUESTIONS:
            # Control-U empties the line that the question before left.
            os.write(terminal, b"\x15" + line.encode() + b"\t")
            assert offered.encode() in answer(terminal, offered.encode()), line
    finally:
        os.close(terminal)
        os.waitpid(child, 0)


def answer(terminal: int, wanted: bytes) -> bytes:
    """Return what the terminal shows until it shows `wanted`, or until patience ends."""
    shown, end = b"", time.monotonic() + PATIENCE
    while wanted not in shown and time.monotonic() < end:
        if select.select([terminal], [], [], 0.1)[0]:
            shown += os.read(terminal, 65536)
    return shown
