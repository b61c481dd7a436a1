"""How benchmarks end: on what they ran, and their figures as JSON where asked for."""

from __future__ import annotations

import json
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from wbc.files import write_text


def finish(console: Console, results: Any, path: str | None) -> None:
    """Print the versions and the machine; write the results as JSON to `path`, if given."""
    console.print(
        f"wbc {version('wbc')}, Python {platform.python_version()}, numpy {np.__version__}, "
        f"{platform.machine()}"
    )
    if path:
        write_text(Path(path), json.dumps(results, indent=2) + "\n")
