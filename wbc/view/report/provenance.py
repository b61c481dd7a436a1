"""Where a result came from: enough to reproduce it."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import wbc
from wbc.measurement import Log

_PACKAGES = ("wbc", "pin", "numpy", "scipy", "proxsuite", "plotly", "meshcat")


def provenance(logs: Sequence[Log], command: str, seed: int | None) -> dict[str, str]:
    """Return label -> text: command, seed, versions, commit, time of writing, hashes of the data.

    Args:
        logs: their files' SHA-256 are listed.
        command: how to run it again; left out when empty.
        seed: of random numbers; left out when None.
    """
    facts = {"command": command} if command else {}
    if seed is not None:
        facts["seed"] = f"{seed} (blocks drawn for the intervals)"
    facts["versions"] = ", ".join(f"{name} {_version(name)}" for name in _PACKAGES)
    facts["python"] = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    commit = _commit()
    if commit:
        facts["commit"] = commit
    facts["written"] = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    for log in logs:
        digest = f"sha256 {log.source.sha256}" if log.source.sha256 else "made in memory"
        facts[f"data: {Path(log.source.label).name}"] = digest
    return facts


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "?"


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
