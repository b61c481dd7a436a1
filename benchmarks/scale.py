"""What one item of work costs at scale: designs, log sets, jobs, bytes, memory.

    python -m benchmarks.scale

The paper calculation of docs/guide/gearbox-design.md multiplies these figures. Processor times are
of one core; what a job costs is the time from one result to the next with two workers that have
nothing to do.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pickle
import resource
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from benchmarks.controller import machine
from wbc import load_robot, save_robot
from wbc.design import Study, describe_columns, parse_sweep
from wbc.design.work import ANALYTIC_CHUNK, evaluate_chunk
from wbc.effects import CoulombFriction, TransmissionEfficiency
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.intervals import bootstrap_steps
from wbc.identification.trend.fleet import diagnosed_row
from wbc.identification.trend.measure import Session
from wbc.identification.trend.stored import SESSION_COLUMNS, measured_rows
from wbc.measurement import save_log
from wbc.parallel import run_jobs
from wbc.results import Column, ResultTable
from wbc.samples import sample_logs

ROBOT = "planar_leg_fixed"
PARTS = 20


def cpu(work: Callable[[], object], rounds: int = 1) -> float:
    """Return the processor time [s] of a piece of work."""
    start = time.process_time()
    for _ in range(rounds):
        work()
    return (time.process_time() - start) / rounds


def peak() -> float:
    """Return the largest memory that this process has had so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def designs(folder: Path) -> list[tuple[str, float, str]]:
    """Return what a design costs in evaluation, writing and bytes; and the memory of one writer."""
    sweeps = ["reduction=6:160", "forward_efficiency=0.5:0.98"]
    sweeps += ["length.shin=0.2:0.5", "mass.thigh=1:3"]
    robot = load_robot("planar_leg")
    pose = tuple(robot.pose("paper").tolist())
    total = PARTS * ANALYTIC_CHUNK
    study = Study("planar_leg", tuple(map(parse_sweep, sweeps)), "foot", pose, samples=total)
    evaluate_chunk(study, (0, 100))
    spent = cpu(lambda: evaluate_chunk(study, (0, ANALYTIC_CHUNK)))
    part = evaluate_chunk(study, (0, ANALYTIC_CHUNK))
    columns = {name: Column(unit) for name, unit in describe_columns(study).items()}
    table = ResultTable(folder / "designs.parquet", {}, columns, PARTS)
    table.begin()
    written = cpu(lambda: [table.add(k, part) for k in range(PARTS)])
    before = peak()
    joined = cpu(table.finish)
    sent = len(pickle.dumps(part))
    return [
        ("design: evaluate", 1e6 * spent / ANALYTIC_CHUNK, "us"),
        ("design: write its part", 1e6 * written / total, "us"),
        ("design: join its part at the end", 1e6 * joined / total, "us"),
        ("design: table", table.path.stat().st_size / total, "bytes"),
        ("design: traffic", sent / ANALYTIC_CHUNK, "bytes"),
        (f"memory that joining {total} designs adds", peak() - before, "MB"),
    ]


def log_sets(folder: Path) -> list[tuple[str, float, str]]:
    """Return what one log set costs: its diagnosis, its measurement for a trend, its bytes."""
    robot, logs = load_robot(ROBOT), sample_logs()
    paths = tuple(str(save_log(log, folder / f"run{k}.npz")) for k, log in enumerate(logs))
    found = [CoulombFriction("hip", 0.5), TransmissionEfficiency("knee", 0.8, 0.75)]
    fitted = save_robot(robot.lossless().with_effects(*found), folder / "fitted.toml")
    one = Session(ROBOT, True, None, "leg", "2026-03-01T00:00:00", paths)
    same = Session(str(fitted), False, None, "leg", "2026-03-01T00:00:00", paths)
    row: dict[str, object] = {}
    diagnosed_row(None, one)  # compiles
    spent = cpu(lambda: row.update(diagnosed_row(None, one)))
    measured_rows(same)
    measured = cpu(lambda: measured_rows(same), 3)
    table = ResultTable(folder / "trend.parquet", {}, SESSION_COLUMNS, 200)
    table.begin()
    rows = measured_rows(same)
    added = cpu(lambda: [table.add(k, rows) for k in range(200)])
    joined = cpu(table.finish)
    seconds = sum(float(log.time[-1] - log.time[0]) for log in logs)
    return [
        ("log set: its length", seconds, "s"),
        ("log set: diagnosis", spent, "s"),
        ("log set: row of the diagnosis", len(pickle.dumps(row)) / 1e3, "kB"),
        ("log set: measured for a trend", measured, "s"),
        ("log set: write its part and join it", 1e3 * (added + joined) / 200, "ms"),
        ("log set: row in the table of the trend", table.path.stat().st_size / 200 / 1e3, "kB"),
    ]


def jobs() -> list[tuple[str, float, str]]:
    """Return what one job costs beside its work, and all draws of one bootstrap."""
    fit_problem = EstimationProblem.from_logs(load_robot(ROBOT).lossless(), sample_logs())
    found = [CoulombFriction("hip", 0.5), TransmissionEfficiency("knee", 0.8, 0.75)]
    fit = fit_problem.fit(found)
    bootstrap_steps(fit, fit_problem.blocks)
    draws = cpu(lambda: bootstrap_steps(fit, fit_problem.blocks), 20)
    from distributed import LocalCluster

    list(run_jobs(abs, range(20), workers=2))
    start = time.perf_counter()
    list(run_jobs(abs, range(200), workers=2))
    process = (time.perf_counter() - start) / 200
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        list(run_jobs(abs, range(20), cluster=cluster.scheduler_address))
        start = time.perf_counter()
        list(run_jobs(abs, range(200), cluster=cluster.scheduler_address))
        remote = (time.perf_counter() - start) / 200
    return [
        ("bootstrap: all 400 draws", 1e3 * draws, "ms"),
        ("job: beside its work, joblib", 1e3 * process, "ms"),
        ("job: beside its work, Dask", 1e3 * remote, "ms"),
    ]


def main() -> None:
    table = Table("what", "cost", "", box=None)
    with TemporaryDirectory() as folder:
        for name, value, unit in [*designs(Path(folder)), *log_sets(Path(folder)), *jobs()]:
            table.add_row(name, f"{value:.3g}", unit)
    console = Console(width=100)
    console.print(machine("wbc", "pyarrow", "joblib", "distributed"))
    console.print(table)


if __name__ == "__main__":
    main()
