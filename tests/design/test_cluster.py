"""A study on a local Dask cluster that loses a busy worker midway."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from wbc.design import Study, parse_sweep, run_study
from wbc.effects import load_robot
from wbc.errors import ParallelError
from wbc.parallel import run_jobs

distributed = pytest.importorskip("distributed", reason="needs Dask: pip install 'wbc[cluster]'")


class KillingWatch:
    """Counts the parts that are done, and kills a busy worker after some of them."""

    def __init__(self, client: Any, after: int) -> None:
        self.client, self.after = client, after
        self.process = client.run(os.getpid)
        self.counts: list[int] = []
        self.lost = 0  # jobs that the killed worker had

    def __call__(self, done: int, total: int) -> None:
        """Note what is done; what `fill_table` calls."""
        if len(self.counts) >= self.after and not self.lost:
            jobs = self.client.processing()
            busiest = max(jobs, key=lambda address: len(jobs[address]))
            self.lost = len(jobs[busiest])
            if self.lost:  # a moment may find all workers between two jobs
                os.kill(self.process[busiest], signal.SIGKILL)
        self.counts.append(done)


@pytest.fixture
def client() -> Iterator[Any]:
    """A client of two workers of its own: each test kills one, and none waits for its return."""
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_a_study_on_a_cluster_that_loses_a_worker_has_the_same_bytes(
    client: Any, tmp_path: Path
) -> None:
    sweeps = tuple(map(parse_sweep, ("reduction=6:160", "forward_efficiency=0.5:0.98")))
    pose = tuple(load_robot("planar_leg").pose("paper").tolist())
    study = Study("planar_leg", sweeps, "foot", pose, samples=2000, seed=9)
    one = run_study(study, tmp_path / "one.parquet", chunk=50)
    address, watch = client.scheduler.address, KillingWatch(client, after=5)
    path = run_study(study, tmp_path / "two.parquet", cluster=address, chunk=50, watch=watch)
    assert watch.lost > 0
    assert watch.counts == list(range(0, 2001, 50))  # every part once
    assert path.read_bytes() == one.read_bytes()


def test_no_workers_and_no_scheduler_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ParallelError, match="workers is 0"):
        list(run_jobs(len, ["a"], workers=0))
    monkeypatch.setattr("wbc.parallel._PATIENCE", 0.5)
    with pytest.raises(ParallelError, match="no Dask scheduler"):
        list(run_jobs(len, ["a"], cluster="tcp://127.0.0.1:1"))
