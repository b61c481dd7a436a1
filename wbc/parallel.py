"""The one way to work on many things at once: processes on this computer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from typing import TypeVar

from wbc.errors import ParallelError
from wbc.extras import needs

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def run_jobs(
    function: Callable[[_Item], _Result], items: Iterable[_Item], workers: int = 1
) -> Iterator[_Result]:
    """Yield the results of `function` on each of `items`, in their order.

    Args:
        function: of a module, so that other processes can import it.
        items: what it is called with.
        workers: processes; 1 works in this process, -1 takes all cores.

    Raises:
        ParallelError: workers is 0, or a job that ends its process.
        MissingPackageError: joblib is not installed.
    """
    if workers == 0:
        raise ParallelError("workers is 0; give a number of processes, or -1 for all cores.")
    if workers == 1:
        yield from map(function, items)
        return
    with needs("design", "working in several processes"):
        from joblib import Parallel, delayed
    try:
        yield from Parallel(workers, return_as="generator")(delayed(function)(x) for x in items)
    except BrokenExecutor as cause:
        raise ParallelError(
            "a job ended the process in which it ran. Too little memory is a usual cause: give "
            "fewer workers."
        ) from cause
