"""The `wbc` command: parses, calls, prints, and tells in one line what went wrong."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from wbc.cli.options import COMMANDS, MODULES, build_parser
from wbc.errors import WbcError, needs

# The matrices are small: with two threads of linear algebra a diagnosis of a recorded arm takes 120
# instead of 69 s of processor time, and as long. Libraries read this when they are loaded.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    Args:
        arguments: command line without the program's name; the process's own when left out.
    """
    options, unknown = build_parser().parse_known_args(arguments)
    if unknown:  # argparse alone shows the usage of `wbc`, which names no option of any command
        options.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    try:
        return _run(options)
    except (WbcError, OSError) as error:
        text = str(error)
        if isinstance(error, OSError):
            place = f"'{error.filename}': " if error.filename else ""
            text = f"{place}{error.strerror or error}."
        print(f"wbc: {text}", file=sys.stderr)
        if findings := getattr(error, "findings", ()):
            from rich.console import Console

            from wbc.cli.inputs import write_fix

            write_fix(options, findings, Console(stderr=True, markup=False, highlight=False))
        return 2
    except KeyboardInterrupt:
        return 130


def _run(options: argparse.Namespace) -> int:
    """Import what the command needs, check what it will write, run it, and write its JSON."""
    module = next(name for name, commands in MODULES.items() if options.command in commands)
    with needs("cli", "the command wbc"):
        from wbc.cli.outputs import PatientConsole, require_outputs, write_json

        command = import_module(f"wbc.cli.{module}")
    require_outputs(options, COMMANDS[options.command].options.split())
    target = getattr(options, "json", None)
    console = PatientConsole(markup=False, quiet=target == "-")
    code, content = getattr(command, f"run_{options.command}")(options, console)
    write_json(target, content, console)
    return int(code)
