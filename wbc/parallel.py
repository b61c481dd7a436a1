"""Many independent jobs: processes on this computer, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from joblib import Parallel, delayed

from wbc.errors import ParallelError

Job = TypeVar("Job")
Result = TypeVar("Result")


def run_jobs(
    function: Callable[[Job], Result],
    jobs: Iterable[Job],
    *,
    workers: int = 1,
    cluster: str | None = None,
) -> Iterator[Result]:
    """Yield the result of every job as it comes, in any order, each once.

    A worker that dies takes nothing with it: on a cluster its jobs are run again by another one.
    Function, jobs and results are pickled; what a job needs of time and chance it should hold.

    Args:
        function: what is done with a job; defined in a module, so that workers find it.
        jobs: small descriptions of work.
        workers: processes on this computer; 1 works in this process, -1 takes all cores.
        cluster: address of a Dask scheduler instead, for example "tcp://10.0.0.1:8786".

    Raises:
        ParallelError: no workers, Dask is not installed, no scheduler at the address.
    """
    if cluster:
        yield from _on_cluster(function, jobs, cluster)
        return
    if workers == 0:
        raise ParallelError("workers must be a number of processes, or -1 for all cores, not 0.")
    pool = Parallel(n_jobs=workers, return_as="generator_unordered")
    yield from pool(delayed(function)(job) for job in jobs)


def _on_cluster(
    function: Callable[[Job], Result], jobs: Iterable[Job], address: str
) -> Iterator[Result]:
    try:
        from distributed import Client, as_completed
    except ImportError as cause:
        raise ParallelError("--cluster needs Dask: pip install 'wbc[cluster]'.") from cause
    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as cause:
        raise ParallelError(f"--cluster '{address}': no Dask scheduler there ({cause}).") from cause
    with client:
        futures = [client.submit(function, job, pure=False) for job in jobs]
        for _, result in as_completed(futures, with_results=True):
            yield result
