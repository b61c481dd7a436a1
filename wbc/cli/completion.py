"""`wbc completion`: the script that lets a shell complete commands, options, robots and files."""

from __future__ import annotations

import argparse

import shtab
from rich.console import Console

from wbc.cli.options import build_parser
from wbc.cli.outputs import Outcome
from wbc.effects import EFFECTS
from wbc.robot import robot_names

_FILES = {
    "bash": "_wbc_files",
    "zsh": "_files",
    "fish": "(__fish_complete_path (commandline -ct))",
    "tcsh": "f",
}
_ROBOTS = {"bash": "_wbc_robots", "zsh": "_wbc_robots", "fish": "(_wbc_robots)", "tcsh": "f"}
_EFFECTS = {"bash": "_wbc_effects", "zsh": "_wbc_effects", "fish": "(_wbc_effects)", "tcsh": "f"}
_FILE_MARKS = ("LOG", "RUN", "FILE", "MAP", "INDEX", "FITTED", "DIR")
"""How the metavar of an argument that names a file begins."""


def run(options: argparse.Namespace, console: Console) -> Outcome:
    """Print the script."""
    parser = build_parser()
    _describe(parser)
    script = shtab.complete(parser, options.shell, preamble=_preamble())
    console.out(script, highlight=False)
    return 0, {}


def _describe(parser: argparse.ArgumentParser) -> None:
    """Tell shtab what each argument that has no choices of its own stands for."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _describe(command)
        elif action.metavar in ("NAME", "ROBOT") and action.dest == "robot":
            action.complete = _ROBOTS  # type: ignore[attr-defined]
        elif action.dest == "add":
            action.complete = _EFFECTS  # type: ignore[attr-defined]
        elif str(action.metavar).startswith(_FILE_MARKS):
            action.complete = _FILES  # type: ignore[attr-defined]


def _preamble() -> dict[str, str]:
    """Return the shell functions that complete robots, effects and files."""
    robots, effects = " ".join(robot_names()), " ".join(("auto", *EFFECTS))
    bash = f"""
_wbc_files() {{ compgen -f -- "$1"; }}
_wbc_robots() {{ compgen -W "{robots}" -- "$1"; compgen -f -- "$1"; }}
_wbc_effects() {{ compgen -W "{effects}" -- "$1"; }}
"""
    zsh = f"""
_wbc_robots() {{ compadd {robots}; _files; }}
_wbc_effects() {{ compadd {effects}; }}
"""
    fish = f"""
function _wbc_robots; printf '%s\\n' {robots}; __fish_complete_path (commandline -ct); end
function _wbc_effects; printf '%s\\n' {effects}; end
"""
    return {"bash": bash, "zsh": zsh, "fish": fish}
