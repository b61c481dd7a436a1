"""Compiling ahead: which module comes before which, and that nothing is left for the first use."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import wbc
from wbc.compile_all import compiled_modules

ROOT = Path(wbc.__file__).parents[1]


def test_no_job_starts_before_what_its_loops_call():
    """The order is checked by importing in it: nobody may load a loop whose turn comes later."""
    needed = compiled_modules()
    order: list[str] = []
    while len(order) < len(needed):
        ready = [name for name in needed if name not in order and needed[name] <= set(order)]
        assert ready, "jobs wait for each other"
        order.append(ready[0])
    code = (
        "import sys, importlib\n"
        f"order = {order!r}\n"
        "for place, name in enumerate(order):\n"
        "    importlib.import_module(name)\n"
        "    early = [later for later in order[place + 1:] if later in sys.modules]\n"
        "    assert not early, (name, early)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


def test_every_file_with_loops_belongs_to_a_job():
    """Read from the syntax trees, not with the search for a text that the module uses."""
    jobs = set(compiled_modules())
    for path in (ROOT / "wbc").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and any(
                isinstance(d, ast.Call) and getattr(d.func, "id", "") == "compiled"
                for d in node.decorator_list
            ):
                name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
                assert name in jobs or name.startswith("wbc.control."), name


def test_what_was_compiled_ahead_is_found_again(tmp_path):
    """One small job, compiled by a worker into an empty folder, is loaded by the next process."""
    run = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    module = "wbc.measurement.motion.filter_loop"
    ahead = (
        "import wbc.compile_all as ahead\n"
        f"ahead.compiled_modules = lambda: {{{module!r}: frozenset()}}\n"
        "print(ahead.compile_all(1))"
    )
    done = subprocess.run(
        [sys.executable, "-c", ahead], env=run, cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["1"]
    look = (
        f"import {module} as found\n"
        "kept = [f for f in vars(found).values() if hasattr(f, 'py_func')]\n"
        "print(len(kept), sum(sum(f.stats.cache_hits.values()) for f in kept))"
    )
    done = subprocess.run(
        [sys.executable, "-c", look], env=run, cwd=ROOT, capture_output=True, text=True, check=True
    )
    functions, hits = map(int, done.stdout.split())
    assert functions == hits > 0
