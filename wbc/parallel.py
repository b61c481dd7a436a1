"""The one way to work on many things at once: processes, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass
from itertools import islice
from textwrap import shorten
from typing import Generic, TypeVar

from wbc.errors import ParallelError
from wbc.extras import needs

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_PATIENCE = 10.0  # [s] for a scheduler that has just been started, between looks at its workers
_ABANDONED = 60.0  # [s] without any worker of a cluster, after which the work ends
_LISTED, _NAMED = 10, 200  # jobs that an error names, and letters of each

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
    result has been used, so memory does not grow with the number of items.

    A job whose process or Dask worker is lost runs again, alone. If it is lost again, the job
    itself ends its process; the others still run, and an error that names it comes last.

    Args:
        function: of a module, so that other processes can import it.
        items: what it is called with; may be a generator.
        workers: processes on this computer; 1 works in this process, -1 takes all cores.
        cluster: address of a Dask scheduler instead, for example "tcp://10.0.0.1:8786".

    Raises:
        ParallelError: workers is 0, no cluster at the address, or jobs that end their process.
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

        def executor() -> Executor:  # a new one where the last one lost a process
            made: Executor = get_reusable_executor(max_workers=count, env=single)
            return made

        yield from _Window(executor, function, lambda: count, (BrokenExecutor,)).results(items)


def _on_cluster(
    function: Callable[[_Item], _Result], items: Iterable[_Item], address: str
) -> Iterator[_Result]:
    with needs("cluster", "working on a Dask cluster"):
        from distributed import Client, KilledWorker
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as cause:
        raise ParallelError(f"--cluster '{address}': no Dask scheduler there ({cause}).") from cause
    with client:
        executor = client.get_executor(pure=False)
        window = _Window(
            lambda: executor, function, lambda: sum(client.nthreads().values()), (KilledWorker,)
        )
        yield from window.results(items)


@dataclass(eq=False)
class _Window(Generic[_Item, _Result]):
    """Jobs of which at most `OPEN` for each of `count()` workers are open.

    Attributes:
        executor: returns one that works.
        function: what a job calls.
        count: returns the workers that are there.
        lost: errors of jobs whose process was lost, whoever's fault it was.
    """

    executor: Callable[[], Executor]
    function: Callable[[_Item], _Result]
    count: Callable[[], int]
    lost: tuple[type[BaseException], ...]

    def results(self, items: Iterable[_Item]) -> Iterator[_Result]:
        """Yield the results as they come; raise what a job raises.

        Raises:
            ParallelError: jobs that end their process each time, after all others are done.
        """
        left, jobs, until_asked, width = iter(items), dict[Future[_Result], _Item](), 0, 0
        deadly: list[_Item] = []
        try:
            while True:
                if until_asked <= 0:  # workers of a cluster come and go; asking takes a message
                    width = until_asked = OPEN * max(self.count(), 1)
                free = max(width - len(jobs), 0)  # below zero where workers were lost
                jobs |= {self._started(item): item for item in islice(left, free)}
                if not jobs:
                    break
                done = self._first(jobs)
                until_asked -= len(done)
                if any(self._was_lost(job) for job in done):
                    # One lost process ends all that are open on this computer. Whose fault it was
                    # shows when each of them runs alone.
                    done |= self._all(jobs)
                suspects = [jobs.pop(job) for job in list(done) if self._was_lost(job)]
                for job in [job for job in done if job in jobs]:
                    del jobs[job]
                    yield job.result()
                for item in suspects:
                    alone = self._started(item)
                    jobs[alone] = item
                    self._all(jobs)
                    del jobs[alone]
                    if self._was_lost(alone):
                        deadly.append(item)
                    else:
                        yield alone.result()
        finally:
            for job in jobs:
                job.cancel()
        if deadly:
            raise ParallelError(_told_deadly(deadly))

    def _started(self, item: _Item) -> Future[_Result]:
        try:
            return self.executor().submit(self.function, item)
        except self.lost as error:  # a process was lost a moment ago
            broken = Future[_Result]()
            broken.set_exception(error)
            return broken

    def _was_lost(self, job: Future[_Result]) -> bool:
        return isinstance(job.exception(), self.lost)

    def _all(self, jobs: Iterable[Future[_Result]]) -> set[Future[_Result]]:
        """Wait for all jobs."""
        left, done = set(jobs), set[Future[_Result]]()
        while left:
            more = self._first(left)
            left, done = left - more, done | more
        return done

    def _first(self, jobs: Iterable[Future[_Result]]) -> set[Future[_Result]]:
        """Wait for the first of jobs.

        Raises:
            ParallelError: no worker was there for `_ABANDONED` seconds.
        """
        every, idle = list(jobs), 0.0
        while True:
            done = wait(every, timeout=_PATIENCE, return_when=FIRST_COMPLETED).done
            if done:
                return done
            idle = 0.0 if self.count() else idle + _PATIENCE
            if idle >= _ABANDONED:
                raise ParallelError(
                    f"no worker of the cluster was there for {_ABANDONED:.0f} s. Start workers, "
                    "and give the same command again: what is done is kept."
                )


def _told_deadly(items: Sequence[object]) -> str:
    """Return whose jobs ended their process."""
    named = [shorten(repr(item), _NAMED, placeholder="...") for item in items[:_LISTED]]
    more = f" and {len(items) - _LISTED} more" if len(items) > _LISTED else ""
    told = "1 job ends" if len(items) == 1 else f"{len(items)} jobs end"
    return (
        f"{told} the process in which it runs, each time, and has no result: {', '.join(named)}"
        f"{more}. All other jobs are done. Too little memory is a usual cause; run it alone with "
        "one worker to see."
    )
