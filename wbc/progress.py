"""A bar of progress in a terminal; silent when piped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from wbc.extras import needs

if TYPE_CHECKING:
    from rich.console import Console

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
