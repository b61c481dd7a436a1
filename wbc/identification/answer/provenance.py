"""Where a result came from: enough to reproduce it."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import wbc
from wbc.identification.model.intervals import BOOTSTRAP_SEED
from wbc.measurement import LogSource

_PACKAGES = ("wbc", "pin", "numpy", "scipy", "proxsuite")


def provenance(sources: Sequence[LogSource], command: str = "") -> dict[str, Any]:
    """Return versions, commit, seed and the hashes of the logs; equal for equal results.

    Args:
        sources: of the logs.
        command: how to run it again; left out when empty.
    """
    facts: dict[str, Any] = {"command": command} if command else {}
    facts["logs"] = [
        {"file": s.path, "part": s.part, "columns": s.mapping, "sha256": s.sha256} for s in sources
    ]
    facts["seed"] = BOOTSTRAP_SEED
    facts["versions"] = {name: _version(name) for name in _PACKAGES}
    facts["python"] = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    facts["commit"] = _commit()
    return facts


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "?"


@cache
def _commit() -> str:
    """Return the commit of the checkout that the package runs from, empty for an installation."""
    folder = Path(wbc.__file__).resolve().parent.parent
    if not (folder / ".git").exists():
        return ""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=12"],
            capture_output=True,
            text=True,
            check=False,
            timeout=10.0,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip()
