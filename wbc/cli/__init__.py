"""The `wbc` command: parses, calls, prints."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from wbc.errors import MissingPackageError
from wbc.extras import needs

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    Args:
        arguments: command line without the program's name; the process's own when left out.
    """
    try:
        with needs("cli", "the command wbc"):
            from wbc.cli.entry import run
    except MissingPackageError as error:
        print(f"wbc: {error}", file=sys.stderr)
        return 2
    return run(arguments)
