"""Data that lie beside the repository, in ../shared/data, and are no part of it."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"


def outside(name: str) -> Path:
    """Return a file (its part behind # included) or folder of these data, or skip the test."""
    path = DATA / name
    if not Path(str(path).partition("#")[0]).exists():
        pytest.skip(f"the recorded data '{name}' are not beside this repository")
    return path
