"""Every command and option that a message prints is copied out of the message, and works."""

import ast
import re
import shlex
import tomllib
import webbrowser
from pathlib import Path

import pytest

from tests.cli.conftest import LEG, Excited
from wbc.cli import main
from wbc.cli.options import OPTIONS as OPTIONS_OF_COMMANDS
from wbc.effects import CoulombFriction
from wbc.measurement import save_log

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def room(excited_log: Excited, here: Path) -> Path:
    """The working folder, with a log of a leg whose hip rubs."""
    save_log(excited_log((CoulombFriction("hip", 0.7),), duration=2.0), "run.csv")
    return here


def test_the_commands_that_a_newcomer_is_told_lead_to_a_better_robot(
    room: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(*words: str) -> str:
        assert main(list(words)) in (0, 1)
        return capsys.readouterr().out

    strange = (room / "run.csv").read_text().replace(".", "_", 6).replace("rotor_torque", "trq")
    (room / "odd.csv").write_text(strange.replace("_position", "_angle"))
    assert main(["check", "odd.csv", *LEG]) == 2
    (hint,) = re.findall(r"`wbc (init MODEL .*?)`", capsys.readouterr().err)
    said = run(*shlex.split(hint.replace("MODEL", "planar_leg_fixed")))
    (first,) = re.findall(r"next: wbc (check .*)", said)
    run(*shlex.split(first))
    logs = [*shlex.split(first)[1:], "--lossless"]
    said = run("diagnose", *logs, "--quiet")
    save, use = re.findall(r"^    wbc (.*)$", said, re.MULTILINE)
    run(*shlex.split(save), "--quiet")
    run(*shlex.split(use))
    words = [*shlex.split(use)[1:], "--quiet"]
    assert "Nothing is missing" in " ".join(run("diagnose", *words).split())


def test_a_designed_motion_is_played_as_it_says(
    room: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: dict[str, bool] = {}
    monkeypatch.setattr(webbrowser, "open", lambda page: opened.setdefault(page, True))
    monkeypatch.setattr("rich.console.Console.input", lambda *_: "")
    options = "--rounds 1 --duration 2 --speed 3 --span 0.5 --between rotor_inertia@knee"
    assert main(shlex.split(f"experiment planar_leg_fixed {options}")) == 0
    (play,) = re.findall(r"see it: wbc (.*)", capsys.readouterr().out)
    assert main(shlex.split(play)) == 0
    assert opened
    monkeypatch.setattr(webbrowser, "open", lambda page: False)
    assert main(shlex.split(play)) == 2
    (html,) = re.findall(r"with (--html FILE)", capsys.readouterr().err)
    assert main(shlex.split(f"{play} {html.replace('FILE', 'a.html')}")) == 0


def test_every_option_that_a_message_names_is_one() -> None:
    """What is printed anywhere; options of other programs are told by their files."""
    known = {key.partition("/")[0] for key in OPTIONS_OF_COMMANDS}
    texts = [
        node.value
        for path in (ROOT / "wbc").rglob("*.py")
        if path.name not in ("pictures.py", "shown.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]
    named = {option for text in texts for option in re.findall(r"--[a-z][a-z-]+", text)}
    assert named - known <= {"--help", "--version"}
    assert len(named) > 40


def test_every_package_that_a_message_names_is_one_of_the_project() -> None:
    text = "".join(path.read_text() for path in (ROOT / "wbc").rglob("*.py"))
    named = set(re.findall(r"pip install '?([\w\[\]{}.()', -]+?)[.'\"]", text))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = {re.split(r"[>=\[]", package)[0] for one in extras.values() for package in one}
    pinned = (ROOT / "constraints.txt").read_text()
    for name in named:
        if extra := re.fullmatch(r"wbc\[(\w+)\]", name):
            assert extra[1] in extras
        elif "{" not in name and name != "pandas":  # the first are tried in tests/test_bare.py
            assert name in wanted or re.search(rf"^{name}==", pinned, re.MULTILINE), name
