"""A study and a fleet of logs on a local Dask cluster of which one worker is killed midway."""

from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from wbc.design import Study, parse_sweep, run_study
from wbc.effects import CoulombFriction, load_robot
from wbc.errors import ParallelError
from wbc.identification import compare
from wbc.measurement import Log
from wbc.parallel import run_jobs
from wbc.robot import Robot
from wbc.sim.excitation import record_run

LEG = load_robot("planar_leg_fixed").lossless()
LOGS = [
    record_run(LEG.with_effect(CoulombFriction("hip", 0.1 * k)), LEG, k, 1.0) for k in (1, 2, 3)
]

distributed = pytest.importorskip("distributed", reason="needs Dask: pip install 'wbc[cluster]'")


def error_of(robot: Robot, log: Log) -> float:
    """Return what a robot leaves unexplained of a log; the job of a fleet."""
    return float(compare(robot, [log]).error)


def test_a_cluster_that_loses_a_worker_gives_the_same_bytes(tmp_path: Path) -> None:
    sweeps = tuple(map(parse_sweep, ("reduction=6:160", "forward_efficiency=0.5:0.98")))
    pose = tuple(load_robot("planar_leg").pose("paper").tolist())
    study = Study("planar_leg", sweeps, "foot", pose, samples=4000, seed=9)
    one = run_study(study, tmp_path / "one.parquet", chunk=50)
    with (
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        workers = list(client.run(os.getpid).values())
        assert len(set(workers)) == 3
        counts: list[int] = []

        def watch(done: int, total: int) -> None:
            if len(counts) == 5:
                os.kill(workers[0], signal.SIGKILL)
            counts.append(done)

        address = cluster.scheduler_address
        path = run_study(
            study, tmp_path / "cluster.parquet", cluster=address, chunk=50, watch=watch
        )
        fleet = sorted(run_jobs(partial(error_of, LEG), LOGS, cluster=address))
    assert counts == list(range(0, 4001, 50))  # every part once
    assert path.read_bytes() == one.read_bytes()
    assert fleet == sorted(run_jobs(partial(error_of, LEG), LOGS))
    assert len(set(fleet)) == len(LOGS)


def test_no_workers_and_no_scheduler_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wbc.parallel._PATIENCE", 0.5)
    with pytest.raises(ParallelError, match="workers is 0"):
        list(run_jobs(len, ["a"], workers=0))
    with pytest.raises(ParallelError, match="no Dask scheduler"):
        list(run_jobs(len, ["a"], cluster="tcp://127.0.0.1:1"))
