"""The `wbc` command: parses, calls, prints."""

from wbc.cli.main import main

__all__ = ["main"]
