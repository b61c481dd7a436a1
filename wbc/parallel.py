"""The one way to work on many things at once: processes on this computer; progress of the work.

Progress with the time left is a bar in a terminal, and a line now and then where there is none.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

from wbc.errors import ParallelError, needs

if TYPE_CHECKING:
    from rich.console import Console

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
        way = "Too little memory is a usual cause: give fewer workers."
        raise ParallelError(f"a job ended the process in which it ran. {way}") from cause


_EVERY = 30.0  # [s] between two lines

Watch = Callable[[int, int], None]
"""Called with what is done and the total."""


@contextmanager
def progress_bar(text: str, console: Console | None = None) -> Iterator[Watch]:
    """Yield a function that moves a bar.

    Args:
        text: what is being done.
        console: where the bar is drawn; the process's own when left out.

    Raises:
        MissingPackageError: rich is not installed.
    """
    with needs("cli", "a bar of progress"):
        from rich.progress import Progress
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task(text, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def progress_lines(
    text: str,
    write: Callable[[str], object] = lambda line: print(line, file=sys.stderr, flush=True),
    clock: Callable[[], float] = time.monotonic,
) -> Watch:
    """Return a function that writes a line with the time left, every half minute at most.

    The time left is that of the rest at the rate since the first call, which tells what was there
    before the work began.

    Args:
        text: what is counted.
        write: called with each line; standard error when left out.
        clock: time [s].
    """
    began = last = clock()
    before: int | None = None

    def watch(done: int, total: int) -> None:
        nonlocal before, last
        before, now = done if before is None else before, clock()
        if now - last < _EVERY or done in (before, total):
            return
        last = now
        left = (now - began) * (total - done) / (done - before)
        write(f"{text}: {done} of {total}, {spoken_time(left)} left")

    return watch


def spoken_time(seconds: float) -> str:
    """Return a time in the largest unit of which there are at least two."""
    for unit, size in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
