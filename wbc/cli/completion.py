"""`wbc completion`: the script that lets a shell complete commands, options, robots and files."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import shtab
from rich.console import Console

from wbc.effects import EFFECTS
from wbc.robot import robot_names

SHELLS = ("bash", "zsh", "fish", "tcsh")

_EPILOG = """examples:
  bash:  wbc completion bash > ~/.local/share/bash-completion/completions/wbc
  zsh:   wbc completion zsh > "${fpath[1]}/_wbc"
  fish:  wbc completion fish > ~/.config/fish/completions/wbc.fish
  tcsh:  wbc completion tcsh > ~/.wbc.completion.csh; source it in ~/.cshrc

The script holds the names of the shipped robots; write it again after an
update."""

_FILES = {
    "bash": "_wbc_files",
    "zsh": "_files",
    "fish": "(__fish_complete_path (commandline -ct))",
    "tcsh": "f",
}
_ROBOTS = {"bash": "_wbc_robots", "zsh": "_wbc_robots", "fish": "(_wbc_robots)", "tcsh": "f"}
_EFFECTS = {"bash": "_wbc_effects", "zsh": "_wbc_effects", "fish": "(_wbc_effects)", "tcsh": "f"}


def add_to(commands: Any, parser: Callable[[], argparse.ArgumentParser]) -> None:
    """Add the command's parser.

    Args:
        commands: where to add it.
        parser: makes the parser of the whole command line, which the script describes.
    """
    own = commands.add_parser(
        "completion",
        help="print the script for completion in a shell",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    own.add_argument("shell", choices=SHELLS)
    own.set_defaults(run=lambda options, console: run(options, console, parser()))


def run(options: argparse.Namespace, console: Console, parser: argparse.ArgumentParser) -> int:
    """Print the script."""
    _describe(parser)
    script = shtab.complete(parser, options.shell, preamble=_preamble())
    console.out(script, highlight=False)
    return 0


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
        elif action.dest in ("logs", "run_file", "columns", "save", "json", "report", "index") or (
            action.dest in ("ghost", "html", "png", "gif", "figures")
        ):
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
