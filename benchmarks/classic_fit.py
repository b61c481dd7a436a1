"""Diagnosis beside the classic fit on recorded machines: what is left, what it costs.

    python -m benchmarks.classic_fit DATA [--only NAME ...] [--budget SECONDS] [--json FILE]

DATA is the folder with the recorded logs. Both see the same logs, band, weights and folds; what is
left is held out: each fold predicted by numbers that were fitted without it. The classic fit is
`wbc identify`: base parameters, rotor inertias, viscous and Coulomb friction, offsets.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from importlib.metadata import version
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from wbc import load_robot
from wbc.files import write_text
from wbc.identification import diagnose
from wbc.identification.classic.classic_fit import classic_fit, held_out_residual
from wbc.identification.model.problem import Problem
from wbc.measurement import load_logs

ROBOTS = Path(__file__).resolve().parents[1] / "robots"
MACHINES = {
    "emps": "emps/emps_estimation.parquet",
    "double_pendulum": "dfki_double_pendulum/double_pendulum.parquet#A.0/trajectory*",
    "double_pendulum_c0": "dfki_double_pendulum/double_pendulum.parquet#C.0/trajectory*",
    "double_pendulum_c1": "dfki_double_pendulum/double_pendulum.parquet#C.1/1*",
    "staubli_tx40": "staubli_tx40/tx40.parquet",
    "tiago": "tiago/tiago.parquet",
}


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
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
        results[name] = measure(name, str(path), options.budget)
        console.print(table_of(name, results[name]))
    console.print(
        f"wbc {version('wbc')}, Python {platform.python_version()}, numpy {np.__version__}, "
        f"{platform.machine()}"
    )
    if options.json:
        write_text(Path(options.json), json.dumps(results, indent=2) + "\n")


def measure(name: str, path: str, budget: float) -> dict[str, Any]:
    """Return what both leave per joint [N m] and their CPU seconds."""
    robot = load_robot(name).lossless()
    logs = load_logs([path], ROBOTS / name / "columns.toml")
    start = time.process_time()
    problem = Problem.from_logs(robot, logs)
    prepared = time.process_time() - start
    classic = classic_fit(problem)
    classic_seconds = time.process_time() - start
    start = time.process_time()
    diagnosis = diagnose(robot, logs, budget=budget)
    seconds = time.process_time() - start
    fit = problem.fit(diagnosis.effects)
    left = held_out_residual(
        problem, lambda used: fit.residual[~used] + fit.jacobian[~used] @ fit.step(used)
    )
    return {
        "joints": list(classic.joints),
        "before": classic.before.tolist(),
        "classic": classic.left.tolist(),
        "diagnosis": np.sqrt(np.mean(left**2, axis=0)).tolist(),
        "preparation_seconds": prepared,
        "classic_seconds": classic_seconds,
        "diagnosis_seconds": seconds,
        "classic_numbers": len(classic.parameters),
        "verdict": diagnosis.verdict,
        "found": [
            [f.effect.name, f.effect.where, round(f.support.group_probability, 3)]
            for f in diagnosis.findings
        ],
    }


def table_of(name: str, result: dict[str, Any]) -> Table:
    """Return one machine's table."""
    table = Table("joint", "before", "classic", "diagnosis", "ratio", box=None, title=name)
    columns = (result[key] for key in ("joints", "before", "classic", "diagnosis"))
    for joint, before, classic, found in zip(*columns, strict=True):
        numbers = (f"{x:.3g}" for x in (before, classic, found, found / classic))
        table.add_row(joint, *numbers)
    table.caption = (
        f"rms held out [N m]; classic {result['classic_numbers']} numbers, "
        f"{result['classic_seconds']:.1f} CPU s; diagnosis {result['verdict']}, "
        f"{len(result['found'])} causes, {result['diagnosis_seconds']:.1f} CPU s"
    )
    return table


if __name__ == "__main__":
    main()
