"""Entry point of the `wbc` command."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib.metadata import version

from rich.console import Console

from wbc.cli import completion
from wbc.cli.logs import check, compare, diagnose, identify, init, play, rollout, trend
from wbc.cli.robots import design, experiment, export, listing, metrics
from wbc.cli.shared.inputs import write_fix
from wbc.errors import WbcError
from wbc.measurement import SuspiciousLogError

_COMMANDS = (
    init,
    check,
    compare,
    diagnose,
    identify,
    rollout,
    trend,
    play,
    metrics,
    design,
    experiment,
    export,
    listing,
)

_EPILOG = """\
example: wbc diagnose run*.csv --robot planar_leg_fixed --save fitted.toml
exit codes: 0 done, 1 unknown, not repeatable or unusable, 2 bad input,
3 above --fail-above, 4 drifts with --fail-on-drift, 130 interrupted"""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="wbc",
        description="Compare a robot model with logs, learn which physics is missing, see it.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"wbc {version('wbc')}")
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", help="its options: wbc COMMAND --help"
    )
    for command in _COMMANDS:
        command.add_to(commands)
    completion.add_to(commands, build_parser)
    return parser


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    Args:
        arguments: command line without the program's name; the process's own when left out.
    """
    options = _parsed(build_parser(), arguments)
    try:
        return int(options.run(options, Console(markup=False)))
    except SuspiciousLogError as error:
        _complain(str(error))
        try:
            write_fix(options, error.findings, Console(stderr=True, markup=False, highlight=False))
        except (WbcError, OSError) as cause:
            _complain(str(cause))
        return 2
    except WbcError as error:
        _complain(str(error))
        return 2
    except BrokenPipeError:
        # The reader of our output has left (wbc ... | head); there is nobody to complain to.
        sys.stderr.close()
        return 0
    except OSError as error:
        place = f"'{error.filename}': " if error.filename else ""
        _complain(f"{place}{error.strerror or error}.")
        return 2
    except KeyboardInterrupt:
        return 130


def _parsed(parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the options; what a command does not know ends with the usage of that command.

    argparse alone shows the usage of `wbc`, which names no option of any command.
    """
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        (commands,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
        commands.choices[options.command].error(f"unrecognized arguments: {' '.join(unknown)}")
    return options


def _complain(text: str) -> None:
    Console(stderr=True, markup=False, highlight=False).print(f"wbc: {text}", soft_wrap=True)
