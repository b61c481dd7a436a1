"""The one way to work on many things at once: processes, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from itertools import islice
from typing import TypeVar

from wbc.errors import ParallelError
from wbc.extras import needs

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_PATIENCE = 10.0  # [s] for a scheduler that has just been started

OPEN = 2
"""Open jobs per worker: one that runs, and one that waits, so that no worker does."""


def run_jobs(
    function: Callable[[_Item], _Result],
    items: Iterable[_Item],
    *,
    workers: int = 1,
    cluster: str | None = None,
) -> Iterator[_Result]:
    """Yield the results of `function` on each of `items` as they come, in any order.

    A result says itself which item it belongs to: function, items and results travel between
    processes. At most `OPEN` jobs per worker are open at a time: the next item is taken when a
    result has been used, so memory does not grow with the number of items. A job whose Dask worker
    is lost runs again on another one.

    Args:
        function: of a module, so that other processes can import it.
        items: what it is called with; may be a generator.
        workers: processes on this computer; 1 works in this process, -1 takes all cores.
        cluster: address of a Dask scheduler instead, for example "tcp://10.0.0.1:8786".

    Raises:
        ParallelError: workers is 0, or no cluster at the address.
        MissingPackageError: the packages for it are not installed.
    """
    if cluster:
        yield from _on_cluster(function, items, cluster)
    elif workers == 1:
        yield from map(function, items)
    elif workers == 0:
        raise ParallelError("workers is 0; give a number of processes, or -1 for all cores.")
    else:
        with needs("design", "working in several processes"):
            from joblib import effective_n_jobs
            from joblib.externals.loky import get_reusable_executor
        count = effective_n_jobs(workers)
        # Each process takes one core: its linear algebra must not take the others'.
        single = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
        executor = get_reusable_executor(max_workers=count, env=single)
        yield from _through_window(executor, function, items, lambda: count)


def _on_cluster(
    function: Callable[[_Item], _Result], items: Iterable[_Item], address: str
) -> Iterator[_Result]:
    with needs("cluster", "working on a Dask cluster"):
        from distributed import Client
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as cause:
        raise ParallelError(f"--cluster '{address}': no Dask scheduler there ({cause}).") from cause
    with client:
        executor = client.get_executor(pure=False)
        yield from _through_window(
            executor, function, items, lambda: sum(client.nthreads().values())
        )


def _through_window(
    executor: Executor,
    function: Callable[[_Item], _Result],
    items: Iterable[_Item],
    count: Callable[[], int],
) -> Iterator[_Result]:
    """Yield results while at most `OPEN` jobs for each of `count()` workers are open."""
    left, jobs, until_asked, width = iter(items), set[Future[_Result]](), 0, 0
    try:
        while True:
            if until_asked <= 0:  # workers of a cluster come and go; asking takes a message
                width = until_asked = OPEN * max(count(), 1)
            free = max(width - len(jobs), 0)  # below zero where workers were lost
            jobs |= {executor.submit(function, item) for item in islice(left, free)}
            if not jobs:
                return
            done, jobs = wait(jobs, return_when=FIRST_COMPLETED)
            until_asked -= len(done)
            while done:
                yield done.pop().result()
    finally:
        for job in jobs:
            job.cancel()
