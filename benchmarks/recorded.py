"""The recorded machines that benchmarks run on, and the command that they share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.results import finish
from wbc import load_robot
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
}


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
    parser.add_argument("--only", nargs="+", choices=MACHINES, default=list(MACHINES))
    parser.add_argument("--budget", type=float, default=inf, help="of each diagnosis [s]")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    console = Console()
    results = {}
    for name in options.only:
        path = options.data / MACHINES[name]
        if not Path(str(path).partition("#")[0]).exists():
            console.print(f"{name}: no logs at {path}")
            continue
        logs = load_logs([str(path)], ROBOTS / name / "columns.toml")
        results[name], table = measure(name, load_robot(name).lossless(), logs, options.budget)
        console.print(table)
    finish(console, results, options.json)
