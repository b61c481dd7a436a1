"""Jobs are taken from their source only as results are used, in processes and on a cluster."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from wbc.parallel import run_jobs


def squared(number: int) -> int:
    """Return the square of a number; the shortest of jobs."""
    return number * number


def assert_bounded(count: int, **place: str | int) -> None:
    """Never are more than two items per worker open."""
    taken = 0

    def items() -> Iterator[int]:
        nonlocal taken
        for number in range(1, 61):
            taken = number
            yield number

    results = []
    jobs = run_jobs(squared, items(), **place)  # type: ignore[arg-type]
    for used, result in enumerate(jobs):
        results.append(result)
        if used == 10:
            time.sleep(0.5)  # a slow writer must not let results pile up
        assert taken - used <= 2 * count
    assert sorted(results) == [k * k for k in range(1, 61)]


def test_processes_take_a_job_when_a_result_was_used() -> None:
    assert_bounded(2, workers=2)


def test_a_cluster_takes_a_job_when_a_result_was_used() -> None:
    distributed = pytest.importorskip(
        "distributed", reason="needs Dask: pip install 'wbc[cluster]'"
    )
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        assert_bounded(2, cluster=cluster.scheduler_address)


def failing(number: int) -> int:
    """Raise for one of the jobs."""
    if number == 3:
        raise ValueError("job 3")
    return number


def test_an_error_of_a_job_ends_the_work_and_the_processes_work_on() -> None:
    with pytest.raises(ValueError, match="job 3"):
        list(run_jobs(failing, range(20), workers=2))
    assert sorted(run_jobs(squared, range(4), workers=2)) == [0, 1, 4, 9]
