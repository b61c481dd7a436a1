"""Many jobs in several processes, how far they are, and the table of their results."""

from __future__ import annotations

import importlib
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from wbc.errors import ParallelError
from wbc.parallel import run_jobs
from wbc.progress import progress_lines, spoken_time
from wbc.results import Column, ResultTable, fill_table, read_results

NAMED = r"1 job ends .* \(7, .*All other jobs are done"


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


def deadly(job: tuple[int, str]) -> tuple[int, int]:
    """Square a number and note that the job ran; job 7 ends its process each time."""
    number, folder = job
    with open(os.path.join(folder, f"{number}.txt"), "a") as file:
        file.write("x")
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    return number, number * number


def test_a_job_that_ends_its_worker_is_named_and_nothing_else_is_lost(tmp_path: Path) -> None:
    distributed = pytest.importorskip(
        "distributed", reason="needs Dask: pip install 'wbc[cluster]'"
    )
    # Dask blames a job for the first worker that it ends, and what waited there with it.
    strict = {"distributed.scheduler.allowed-failures": 0}
    with (
        importlib.import_module("dask").config.set(strict),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
    ):
        results: list[tuple[int, int]] = []
        jobs = ((k, str(tmp_path)) for k in range(20))
        with pytest.raises(ParallelError, match=NAMED):
            results.extend(run_jobs(deadly, jobs, cluster=cluster.scheduler_address))
        assert sorted(results) == [(k, k * k) for k in range(20) if k != 7]


def test_a_table_keeps_what_is_done_beside_a_job_that_ends_its_process(tmp_path: Path) -> None:
    def table() -> ResultTable:
        columns = {"number": Column(kind="count"), "square": Column(kind="count")}
        return ResultTable(tmp_path / "squares.parquet", {}, columns, 20)

    jobs = [(k, str(tmp_path)) for k in range(20)]
    with pytest.raises(ParallelError, match=NAMED):
        fill_table(table(), rows, jobs, workers=2)
    runs = {k: len((tmp_path / f"{k}.txt").read_text()) for k in range(20)}
    assert runs[7] == 2
    assert sum(runs.values()) <= 20 + 1 + 4  # only what was open with it runs again
    assert table().begin() == set(range(20)) - {7}
    assert not table().path.exists()
    cured = fill_table(table(), cured_rows, jobs)
    assert list(read_results(cured)["square"]) == [k * k for k in range(20)]


def rows(job: tuple[int, str]) -> dict[str, list[int]]:
    """Return the row of a job, where it does not end its process."""
    number, square = deadly(job)
    return {"number": [number], "square": [square]}


def cured_rows(job: tuple[int, str]) -> dict[str, list[int]]:
    """Return the row of the one job that is left, after its cause was mended."""
    assert job[0] == 7
    return {"number": [7], "square": [49]}


def test_a_line_every_half_minute_tells_the_time_left() -> None:
    now = 0.0
    lines: list[str] = []
    watch = progress_lines("sessions", lines.append, lambda: now)
    watch(20, 100)  # what an earlier run left took no time
    for done in range(21, 101):
        now += 10.0
        watch(done, 100)
    assert lines[0] == "sessions: 23 of 100, 13 min left"  # 77 of 10 s each
    assert lines[-1] == "sessions: 98 of 100, 20 s left"
    assert len(lines) == 26  # every 30 s, not at the end


def test_short_work_writes_nothing() -> None:
    lines: list[str] = []
    watch = progress_lines("sessions", lines.append, lambda: 0.0)
    for done in range(11):
        watch(done, 10)
    assert lines == []


def test_times_are_told_in_the_largest_unit() -> None:
    assert [spoken_time(t) for t in (0.4, 119, 120, 7300, 200000)] == [
        "0 s",
        "119 s",
        "2 min",
        "2 h",
        "2 d",
    ]


def test_only_the_named_columns_are_read(tmp_path: Path) -> None:
    columns = {"machine": Column(kind="text"), "diagnosis": Column(kind="text")}
    table = ResultTable(tmp_path / "fleet.parquet", {}, columns, 1)
    table.begin()
    table.add(0, {"machine": ["a", "b"], "diagnosis": ["long", "longer"]})
    path = table.finish()
    assert read_results(path, ["machine"]) == {"machine": ["a", "b"]}
    assert set(read_results(path)) == set(columns)
