"""Data that lie beside the repository, in ../shared/data, and are no part of it."""

from pathlib import Path

import pytest

from wbc import Robot, load_robot
from wbc.measurement import Log, load_logs

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"


def outside(name: str) -> Path:
    """Return a file (its part behind # included) or folder of these data, or skip the test."""
    path = DATA / name
    if not Path(str(path).partition("#")[0]).exists():
        pytest.skip(f"the recorded data '{name}' are not beside this repository")
    return path


def foreign(case: str, runs: str = "run?") -> tuple[Robot, tuple[Log, ...]]:
    """Return the robot of a case, as its user believes it to be, and its logs."""
    folder = outside(f"foreign/{case}")
    columns = next(folder.glob("columns.toml"), None)
    return load_robot(folder / "robot.toml"), load_logs(sorted(folder.glob(f"{runs}.csv")), columns)
