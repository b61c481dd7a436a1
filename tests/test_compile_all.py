"""Compiling ahead: nothing is left out, and nothing is left for the first use."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import wbc
from wbc.compile_all import compiled_functions

ROOT = Path(wbc.__file__).parents[1]


def test_every_compiled_function_is_found():
    """Read from the syntax trees."""
    written = {
        node.name
        for path in (ROOT / "wbc").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
        for d in node.decorator_list
        if isinstance(d, ast.Call) and getattr(d.func, "id", "") == "compiled"
    }
    assert written - {function.py_func.__name__ for function in compiled_functions()} == set()


def test_what_was_compiled_ahead_is_found_again(tmp_path):
    """The functions of a file, compiled by a worker into an empty folder, with what they call."""
    run = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    ahead = (
        "import wbc.compile_all as ahead\n"
        "every = ahead.compiled_functions()\n"
        "some = {f: p for f, p in every.items() if p[0] == 'wbc.effects.tables'}\n"
        "ahead.compiled_functions = lambda: some\n"
        "print(ahead.compile_all(1))"
    )
    done = subprocess.run(
        [sys.executable, "-c", ahead], env=run, cwd=ROOT, capture_output=True, text=True, check=True
    )
    look = (
        "from wbc.compile_all import compiled_functions\n"
        "kept = [f for f, p in compiled_functions().items() if p[0] == 'wbc.effects.tables']\n"
        "for one in kept: one.make_ready()\n"
        "print(sum(sum(f.stats.cache_hits.values()) for f in kept))"
    )
    again = subprocess.run(
        [sys.executable, "-c", look], env=run, cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert int(done.stdout) == int(again.stdout) > 0
