"""Compile all loops of the library ahead of their first use, on all processors.

    python -m wbc.compile_all

Without it the first controller and the first plant compile theirs, on one processor. What is
compiled is kept on disk (see `wbc.compiled`), so this is needed once per installation, for example
while the image of a robot's computer is built.
"""

from __future__ import annotations

import os
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from pathlib import Path

from wbc.compiled import MachineCode

_ROOT = Path(__file__).parent


def compiled_functions() -> dict[MachineCode, tuple[str, str]]:
    """Return every compiled function of the library, with its module and its name there."""
    found: dict[MachineCode, tuple[str, str]] = {}
    for path in sorted(_ROOT.rglob("*.py")):
        if "from wbc.compiled import" in path.read_text(encoding="utf-8") and path != Path(
            __file__
        ):
            name = ".".join(("wbc", *path.relative_to(_ROOT).with_suffix("").parts))
            for attribute, value in vars(import_module(name)).items():
                if isinstance(value, MachineCode):
                    found.setdefault(value, (name, attribute))
    return found


def compile_all(processes: int | None = None) -> int:
    """Compile every function that is not yet kept on disk; return how many there are.

    Those that call no others come first, so that no two processes compile the same one.

    Args:
        processes: that work at once; None takes one for each processor.

    Raises:
        Exception: whatever the compiler says of a function.
    """
    functions = compiled_functions()
    levels: dict[int, list[tuple[str, str]]] = defaultdict(list)
    for function, place in functions.items():
        levels[_level(function)].append(place)
    with ProcessPoolExecutor(processes or os.cpu_count()) as pool:
        for level in sorted(levels):
            list(pool.map(_compile, levels[level]))
    return len(functions)


def _level(function: MachineCode) -> int:
    """Return how many compiled functions call each other below this one, at most."""
    return max((1 + _level(called) for called in function.calls), default=0)


def _compile(place: tuple[str, str]) -> None:
    module, name = place
    vars(import_module(module))[name].make_ready()


if __name__ == "__main__":
    compile_all()
