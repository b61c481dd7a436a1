"""Functions are compiled when they are needed, kept on disk, and found again."""

import ast
import os
import subprocess
import sys
import traceback
import warnings
from contextlib import redirect_stderr, redirect_stdout
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from numba.core import caching
from numba.core.errors import NumbaError

import wbc
from wbc import compiled as compiling
from wbc.compile_all import compiled_functions
from wbc.compiled import Nothing, Number, OutRow, Row, compiled, local


@pytest.fixture
def nowhere(monkeypatch):
    """Leave no folder in which a compiled function could be kept."""
    monkeypatch.setattr(caching.config, "CACHE_LOCATOR_CLASSES", "UserProvidedCacheLocator")
    monkeypatch.setattr(caching.config, "CACHE_DIR", "")
    compiling._warn_of_compiling.cache_clear()
    yield
    compiling._warn_of_compiling.cache_clear()


def doubled(x: float) -> float:
    return 2.0 * x


def test_without_a_folder_functions_are_compiled_with_one_warning(nowhere):
    functions = [compiled(Number, Number)(doubled) for _ in range(2)]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        assert [function(3.0) for function in functions] == [6.0, 6.0]
    assert len(told) == 1
    assert "NUMBA_CACHE_DIR" in str(told[0].message)


def test_errors_of_the_compiler_are_not_taken_for_a_missing_folder():
    with pytest.raises(Exception, match="nothing_of_this_name"):
        compiled(Number, Number)(lambda x: nothing_of_this_name(x))(1.0)  # noqa: F821


def test_small_arrays_live_in_the_call_that_makes_them():
    def swapped(given, found):
        own = local(2)
        own[0], own[1] = given[1], given[0]
        for i in range(2):
            found[i] = own[i]

    found = np.zeros(3)
    compiled(Nothing, Row, OutRow, counted=False)(swapped)(np.array([1.0, 2.0]), found[:2])
    assert found.tolist() == [2.0, 1.0, 0.0]


@compiled(counted=False)
def turned(given: Row, found: OutRow) -> float:
    """Write an array backward and return its first entry."""
    for i in range(len(given)):
        found[i] = given[len(given) - 1 - i]
    return found[0]


def test_a_function_that_makes_arrays_must_count_who_holds_them():
    with pytest.raises(NumbaError):
        compiled(Number, Number, counted=False)(lambda x: x + np.zeros(2)[0])(1.0)


def test_a_first_call_with_other_types_is_refused():
    """It is compiled for the types given or annotated, not for those that come first."""
    total = compiled(Number, Row)(lambda x: x.sum())
    given, found = np.array([1.0, 2.0]), np.zeros(2)
    for function, wrong in (
        (total, [np.zeros((2, 2))]),
        (total, [np.zeros(2, dtype=np.int64)]),
        (turned, [given, np.zeros(4)[::2]]),
    ):
        with pytest.raises(TypeError, match="No matching definition"):
            function(*wrong)
    assert total(np.ones(2)) == 2.0
    assert turned(given, found) == 2.0
    assert found.tolist() == [2.0, 1.0]


CALLER = """
from wbc.compiled import Number, compiled
from callee import FACTOR, inner


@compiled(Number, Number)
def outer(x: float) -> float:
    {text}
    return FACTOR * inner(x)


print(outer(1.0), sum(outer.stats.cache_hits.values()))
"""
CALLEE = """
from wbc.compiled import Number, compiled

FACTOR = {factor}


@compiled(Number, Number)
def inner(x: float) -> float:
    return x + {added}
"""


def program(folder, code):
    """Run code in a folder, with the kept functions beside the sources; return what it prints.

    In a fork of this process, which has loaded the compiler already. Python's own byte code is left
    out: it takes a file that was written twice in a second, with the same number of bytes, for the
    same file.
    """

    def child():
        os.chdir(folder)
        sys.path.insert(0, "")
        sys.dont_write_bytecode, caching.config.CACHE_DIR = True, ""
        compiling._can_be_written.cache_clear()
        compiling._warn_of_compiling.cache_clear()
        warnings.simplefilter("error")
        with open("printed", "w") as out, redirect_stdout(out), redirect_stderr(out):
            try:
                exec(code, {})
            except Exception:
                traceback.print_exc()

    process = get_context("fork").Process(target=child)
    process.start()
    process.join()
    return (folder / "printed").read_text()


READ_ONLY = "import wbc.compiled; wbc.compiled._can_be_written = lambda folder: False"


def test_a_function_is_compiled_anew_when_one_that_it_calls_has_changed(tmp_path):
    """A user who pulls a new version must not go on with machine code of the old one.

    Another comment or docstring changes nothing. Where nothing can be written, what lies beside the
    sources is found.
    """

    def run(factor: str, added: str, text: str = "# Nothing.", before: str = "") -> list[str]:
        """Write both files, run them, and return what they print."""
        (tmp_path / "caller.py").write_text(CALLER.format(text=text))
        (tmp_path / "callee.py").write_text(CALLEE.format(factor=factor, added=added))
        printed = program(tmp_path, f"{before}\nimport caller")
        return [printed] if "Traceback" in printed else printed.split()

    assert run("1.0", "1.0") == ["2.0", "0"]
    assert run("1.0", "1.0", text='"""Return more."""\n    # And more.') == ["2.0", "1"]
    assert run("1.0", "20.0") == ["21.0", "0"]
    assert run("1.25", "20.0") == ["26.25", "0"]
    # Numba would copy a large function, with all that it calls, into each that calls it.
    large = "import wbc.compiled; wbc.compiled._COPIED = 0"
    assert run("2.0", "1.0", before=large) == ["4.0", "0"]
    assert run("2.0", "1.0", before=large) == ["4.0", "1"]
    assert run("2.0", "3.0", before=large) == ["8.0", "0"]
    assert run("1.0", "1.0", before=READ_ONLY) == ["2.0", "1"]
    (told,) = run("1.0", "17.0", before=READ_ONLY)
    assert "NUMBA_CACHE_DIR" in told
    # A file that was renamed, with what it holds unchanged.
    (tmp_path / "callee.py").write_text(CALLEE.format(factor="1.0", added="1.0"))
    (tmp_path / "callee.py").rename(tmp_path / "inner_callee.py")
    text = CALLER.format(text="# Nothing.").replace("from callee", "from inner_callee")
    (tmp_path / "renamed.py").write_text(text)
    (tmp_path / "caller.py").unlink()
    assert program(tmp_path, "import renamed").split()[:1] == ["2.0"]


def test_a_function_is_compiled_anew_when_fields_have_changed_places(tmp_path):
    """A group that it makes in their order, and reads by their names."""
    code = (
        "from typing import NamedTuple\n"
        "from wbc.compiled import Number, compiled\n"
        "class Pair(NamedTuple):\n"
        "    {first}: float\n"
        "    {second}: float\n"
        "@compiled(Number, Number, Number)\n"
        "def left(a, b):\n"
        "    return Pair(a, b).left\n"
        "print(left(1.0, 2.0))\n"
    )
    for first, second, found in (("left", "right", "1.0"), ("right", "left", "2.0")):
        (tmp_path / "pairs.py").write_text(code.format(first=first, second=second))
        assert program(tmp_path, "import pairs").strip() == found


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
    chosen = (
        "import wbc.compile_all as ahead\n"
        "every = ahead.compiled_functions()\n"
        "some = {f: p for f, p in every.items() if p[0] == 'wbc.effects.tables'}\n"
    )
    compiles = "ahead.compiled_functions = lambda: some\nprint(ahead.compile_all(1))"
    hits = "sum(sum(one.stats.cache_hits.values()) for one in some)"
    looks = f"for one in some: one.make_ready()\nprint({hits})"
    run = {"env": {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}, "cwd": ROOT, "text": True}
    compiled_ahead, found = (
        int(subprocess.check_output([sys.executable, "-c", chosen + code], **run))
        for code in (compiles, looks)
    )
    assert compiled_ahead == found > 0


def test_what_a_function_calls_is_defined_before_it(tmp_path):
    """Else the machine code that is kept would not tell when that changes."""
    code = (
        "from wbc.compiled import Number, compiled\n"
        "@compiled(Number, Number)\n"
        "def outer(x):\n"
        "    return inner(x)\n"
        "@compiled(Number, Number)\n"
        "def inner(x):\n"
        "    return x\n"
        "outer(1.0)\n"
    )
    (tmp_path / "late.py").write_text(code)
    assert "NameError: outer calls inner" in program(tmp_path, "import late")
