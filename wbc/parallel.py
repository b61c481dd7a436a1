"""The one way to work on many things at once: processes, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from wbc.errors import ParallelError
from wbc.extras import needs

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def run_jobs(
    function: Callable[[_Item], _Result],
    items: Sequence[_Item],
    *,
    workers: int = 1,
    cluster: str | None = None,
) -> Iterator[_Result]:
    """Yield the results of `function` on each of `items` as they come, in any order.

    A result says itself which item it belongs to: function, items and results travel between
    processes.

    Args:
        function: of a module, so that other processes can import it.
        items: what it is called with.
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
            from joblib import Parallel, delayed
        pool = Parallel(n_jobs=workers, return_as="generator_unordered")
        yield from pool(delayed(function)(item) for item in items)


def _on_cluster(
    function: Callable[[_Item], _Result], items: Sequence[_Item], address: str
) -> Iterator[_Result]:
    with needs("cluster", "working on a Dask cluster"):
        from distributed import Client, as_completed
    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as cause:
        raise ParallelError(f"--cluster '{address}': no Dask scheduler there ({cause}).") from cause
    with client:
        futures = [client.submit(function, item, pure=False) for item in items]
        for _, result in as_completed(futures, with_results=True):
            yield result
