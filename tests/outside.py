"""Data that lie beside the repository, in ../shared/data, and are no part of it."""

from pathlib import Path

import pytest

from wbc import Robot, load_robot
from wbc.measurement import Log, load_logs
from wbc.robot import robots_directory

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"
RECORDED = {
    "double_pendulum": "dfki_double_pendulum/double_pendulum.parquet#A.0/trajectory*",
    "double_pendulum_c0": "dfki_double_pendulum/double_pendulum.parquet#C.0/*",
    "double_pendulum_c1": "dfki_double_pendulum/double_pendulum.parquet#C.1/*",
    "emps": "emps/emps_estimation.parquet",
    "staubli_tx40": "staubli_tx40/tx40.parquet",
    "tiago": "tiago/tiago.parquet",
    "go2": "go2_position_control/go2_air.parquet",
    "ricmonk": "ricmonk/TVLQR_?xForward*.parquet",
    "xl330_pendulum": "bam_servo/bam.parquet#xl330*",
}


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
    return load_robot(folder / "robot.toml"), load_logs(
        sorted(folder.glob(f"{runs}.csv*")), columns
    )


def recorded(name: str) -> tuple[Robot, tuple[Log, ...]]:
    """Return a recorded machine, as its data sheets have it, and its logs."""
    file, mark, part = RECORDED[name].partition("#")
    folder = outside(file.partition("/")[0])
    paths = [f"{path}{mark}{part}" for path in sorted(folder.glob(file.partition("/")[2]))]
    robot = load_robot(name)
    gears = robot.transmission
    ratios = dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))
    return robot, load_logs(paths, robots_directory() / name / "columns.toml", gear_ratios=ratios)
