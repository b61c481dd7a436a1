"""A study on a local Dask cluster of which one worker is killed in the middle."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from wbc.design import Study, parse_sweep, run_study
from wbc.effects import load_robot

distributed = pytest.importorskip("distributed", reason="needs Dask: pip install 'wbc[cluster]'")


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
    assert counts == list(range(0, 4001, 50))  # every part once
    assert path.read_bytes() == one.read_bytes()
