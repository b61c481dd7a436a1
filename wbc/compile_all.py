"""Compile all loops of the library ahead of their first use, on all processors.

    python -m wbc.compile_all

Without it the first import of `wbc.control` and of `wbc.sim.plant` compiles them, on one processor.
What is compiled is kept on disk (see `wbc.compiled`), so this is needed once per installation, for
example while the image of a robot's computer is built.
"""

from __future__ import annotations

import ast
import os
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from importlib import import_module
from pathlib import Path

_ROOT = Path(__file__).parent
_MARK = "@compiled("


def _name(path: Path) -> str:
    """Return the name under which a file of this package is imported."""
    parts = ("wbc", *path.relative_to(_ROOT).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _parents(name: str) -> set[str]:
    """Return a module and the packages that Python imports before it."""
    parts = name.split(".")
    return {".".join(parts[:end]) for end in range(1, len(parts) + 1)}


def _imported(tree: ast.Module, known: set[str]) -> set[str]:
    """Return which modules of this package a file imports as soon as it is imported itself."""
    found: set[str] = set()
    for line in tree.body:
        if isinstance(line, ast.Import):
            found |= {alias.name for alias in line.names}
        elif isinstance(line, ast.ImportFrom) and line.module:
            found |= {line.module} | {f"{line.module}.{alias.name}" for alias in line.names}
    return set().union(*(_parents(name) for name in found)) & known


def _closed(needs: dict[str, set[str]]) -> dict[str, frozenset[str]]:
    """Return all modules that each module needs, directly or through others, with itself."""
    closed: dict[str, frozenset[str]] = {}
    for name in needs:
        seen, left = {name}, [name]
        while left:
            new = needs[left.pop()] - seen
            seen |= new
            left += new
        closed[name] = frozenset(seen)
    return closed


def compiled_modules() -> dict[str, frozenset[str]]:
    """Return every module with compiled loops, and those that have to be compiled before it.

    Modules that import each other in a ring, as all below a package that imports its parts do, are
    one job: the first name stands for all.
    """
    files = {_name(path): path.read_text(encoding="utf-8") for path in _ROOT.rglob("*.py")}
    files.pop("wbc.compile_all")
    known = set(files)
    needs = {
        name: (_imported(ast.parse(text), known) | _parents(name)) & known
        for name, text in files.items()
    }
    closed = _closed(needs)
    loops = sorted(name for name, text in files.items() if _MARK in text)
    first = {name: min(n for n in loops if closed[n] == closed[name]) for name in loops}
    return {
        name: frozenset(first[n] for n in loops if n in closed[name]) - {name}
        for name in sorted(set(first.values()))
    }


def compile_all(processes: int | None = None) -> int:
    """Compile every loop that is not yet kept on disk; return how many jobs there were.

    Args:
        processes: that work at once; None takes one for each processor.

    Raises:
        Exception: whatever the compiler says of a function.
    """
    needed = compiled_modules()
    followers = {name: sum(name in others for others in needed.values()) for name in needed}
    waiting = sorted(needed, key=lambda name: -followers[name])
    done: set[str] = set()
    with ProcessPoolExecutor(processes or os.cpu_count()) as pool:
        running: dict[Future[None], str] = {}
        while waiting or running:
            for name in [name for name in waiting if needed[name] <= done]:
                running[pool.submit(_compile, name)] = name
                waiting.remove(name)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                future.result()
                done.add(running.pop(future))
    return len(done)


def _compile(name: str) -> None:
    """Import one module, which compiles its loops."""
    import_module(name)


if __name__ == "__main__":
    compile_all()
