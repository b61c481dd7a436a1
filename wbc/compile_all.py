"""Compile all loops of the library ahead of their first use, on all processors.

    python -m wbc.compile_all

Without it the first controller and the first plant compile theirs, on one processor. What is
compiled is kept on disk (see `wbc.compiled`), so this is needed once per installation, for example
while the image of a robot's computer is built.
"""

from __future__ import annotations

import os
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

from wbc.compiled import MachineCode

_ROOT = Path(__file__).parent


def compiled_functions() -> dict[MachineCode, tuple[str, str]]:
    """Return every compiled function of the library, with its module and its name there."""
    found: dict[MachineCode, tuple[str, str]] = {}
    for path in sorted({*_ROOT.rglob("*.py")} - {Path(__file__)}):
        if "from wbc.compiled import" in path.read_text(encoding="utf-8"):
            name = ".".join(("wbc", *path.relative_to(_ROOT).with_suffix("").parts))
            for attribute, value in vars(import_module(name)).items():
                if isinstance(value, MachineCode):
                    found.setdefault(value, (name, attribute))
    return found


def compile_all(processes: int | None = None) -> int:
    """Compile every function that is not yet kept on disk; return how many there are.

    Each after those that it calls, so that no two processes compile the same one.

    Args:
        processes: that work at once; None takes one for each processor.

    Raises:
        Exception: whatever the compiler says of a function.
    """
    functions = compiled_functions()
    order = TopologicalSorter({one: set(one.calls) & set(functions) for one in functions})
    order.prepare()
    jobs: dict[Future[None], MachineCode] = {}
    with ProcessPoolExecutor(processes or os.cpu_count()) as pool:
        while order.is_active():
            jobs |= {pool.submit(_compile, functions[one]): one for one in order.get_ready()}
            for job in wait(jobs, return_when=FIRST_COMPLETED).done:
                job.result()
                order.done(jobs.pop(job))
    return len(functions)


def _compile(place: tuple[str, str]) -> None:
    module, name = place
    vars(import_module(module))[name].make_ready()


if __name__ == "__main__":
    compile_all()
