"""The recorded machines that benchmarks run on, the command that they share, and how they end."""

from __future__ import annotations

import argparse
import json
import platform
from collections.abc import Callable
from importlib.metadata import version
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from wbc import load_robot
from wbc.files import write_text
from wbc.measurement import Log, load_logs
from wbc.robot import Robot

ROBOTS = Path(__file__).resolve().parents[1] / "robots"
MACHINES = {
    "emps": "emps/emps_estimation.parquet",
    "double_pendulum": "dfki_double_pendulum/double_pendulum.parquet#A.0/trajectory*",
    "double_pendulum_c0": "dfki_double_pendulum/double_pendulum.parquet#C.0/trajectory*",
    "double_pendulum_c1": "dfki_double_pendulum/double_pendulum.parquet#C.1/1*",
    "staubli_tx40": "staubli_tx40/tx40.parquet",
    "tiago": "tiago/tiago.parquet",
    "go2": "go2_position_control/go2_air.parquet",
    "xl330_pendulum": "bam_servo/bam.parquet#xl330*",
    "simple_pendulum": "simple_pendulum/direct_collocation.parquet simple_pendulum/ddp.parquet "
    "simple_pendulum/pd_identification.parquet",
    "ricmonk": "ricmonk/TVLQR_3xForward.parquet#* ricmonk/TVLQR_6xForward.parquet#*",
}
"""Robots of this repository -> their logs."""
_BENCH = "tmotor_ak80"
_RUNS = "sysid_1.parquet sysid_2.parquet opposing_2.parquet"
_ARM, _KUKA = "airbot_play", "strangers/01_kuka_sign"
BESIDE = {
    "tmotor_current": (f"{_BENCH}/robot.toml", f"{_BENCH}/current.toml", _BENCH, _RUNS),
    "tmotor_position": (
        f"{_BENCH}/robot.toml",
        f"{_BENCH}/with_position/columns.toml",
        f"{_BENCH}/with_position",
        _RUNS,
    ),
    "tmotor_final_8": (f"{_BENCH}/robot.toml", f"{_BENCH}/current.toml", _BENCH, "final_8.parquet"),
    "tmotor_command": (
        f"{_BENCH}/robot.toml",
        f"{_BENCH}/command.toml",
        _BENCH,
        "sysid_1.parquet sysid_2.parquet",
    ),
    "airbot": (f"{_ARM}/robot.toml", "", _ARM, "chirp.parquet trapezoidal.parquet"),
    "kuka_lwr4": (f"{_KUKA}/robot.toml", "", _KUKA, "k1.csv k2.csv k3.csv"),
}
"""Machines whose description lies with the logs -> robot, column map, folder and runs."""


def run_on_machines(
    description: str,
    measure: Callable[[str, Robot, tuple[Log, ...], float], tuple[Any, Table]],
) -> None:
    """Measure the machines that the command line names; print a table of each, write all.

    Args:
        description: what the command does, in a line.
        measure: name, robot without losses, logs and seconds for a diagnosis -> what is written
            as JSON, and its table.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("data", type=Path)
    parser.add_argument(
        "--only", nargs="+", choices=[*MACHINES, *BESIDE], default=[*MACHINES, *BESIDE]
    )
    parser.add_argument("--budget", type=float, default=inf, help="of each diagnosis [s]")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    console = Console()
    results = {}
    for name in options.only:
        robot, columns, files = _given(options.data, name)
        if missing := [f for f in files if not Path(f.partition("#")[0]).exists()]:
            console.print(f"{name}: no logs at {missing[0]}")
            continue
        logs = load_logs(files, columns if columns.is_file() else None)
        results[name], table = measure(name, load_robot(robot).lossless(), logs, options.budget)
        console.print(table)
    finish(console, results, options.json)


def finish(console: Console, results: Any, path: str | None) -> None:
    """Print the versions and the machine; write the results as JSON to `path`, if given."""
    console.print(
        f"wbc {version('wbc')}, Python {platform.python_version()}, numpy {np.__version__}, "
        f"{platform.machine()}"
    )
    if path:
        write_text(Path(path), json.dumps(results, indent=2) + "\n")


def _given(data: Path, name: str) -> tuple[str, Path, list[str]]:
    """Return the robot of a machine, its column map and its logs."""
    if name in MACHINES:
        files = [str(data / file) for file in MACHINES[name].split()]
        return name, ROBOTS / name / "columns.toml", files
    robot, columns, folder, runs = BESIDE[name]
    files = [str(data / folder / run) for run in runs.split()]
    return str(data / robot), data / columns, files
