"""Every Python block of the README and the docs runs, one page after another in one namespace.

Blocks of shell hold our own commands and run, too.

A block of text right below a block of Python is what the page says is printed. Words must be the
same, numbers within a tenth: libraries and processors round differently, and a page is no
regression test, but it must not promise what does not happen. A line `...` stands for lines
that the page leaves out.
"""

from __future__ import annotations

import code
import contextlib
import io
import re
import runpy
import shlex
from pathlib import Path

import pytest

from wbc.cli import main

ROOT = Path(__file__).resolve().parents[2]
# These run line by line, as at the prompt.
PASTED = ("README.md", "docs/guide/tutorial.md", "docs/guide/tutorial-logs.md")
PAGES = [
    path
    for path in sorted((ROOT / "docs").rglob("*.md"))
    if "_build" not in path.parts and str(path.relative_to(ROOT)) not in PASTED
]
BLOCK = re.compile(
    r"^```(python|sh)\n(.*?)^```$(?:\n+^```text\n(.*?)^```$)?", re.MULTILINE | re.DOTALL
)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def assert_same_text(printed: str, promised: str) -> None:
    """Check that words are equal and numbers within a tenth (or 0.02 near zero)."""
    assert NUMBER.sub("#", printed).split() == NUMBER.sub("#", promised).split(), printed
    found = [float(x) for x in NUMBER.findall(printed)]
    expected = [float(x) for x in NUMBER.findall(promised)]
    assert found == pytest.approx(expected, rel=0.1, abs=0.02), printed


def assert_printed(printed: str, promised: str) -> None:
    """Check a text with lines left out: its pieces stand in what is printed, in this order."""
    pieces = re.split(r"^\.\.\.\n", promised, flags=re.MULTILINE)
    rows, at = printed.splitlines(), 0
    for number, piece in enumerate(pieces):
        first, count = NUMBER.sub("#", piece.split("\n", 1)[0]).split(), piece.count("\n")
        if number == len(pieces) - 1 and piece:
            assert_same_text("\n".join(rows[max(at, len(rows) - count) :]), piece)
        elif piece:
            starts = [at] if number == 0 else range(at, len(rows))
            found = [k for k in starts if NUMBER.sub("#", rows[k]).split() == first]
            assert found, f"{piece.splitlines()[0]!r} is not in:\n{printed}"
            at = found[0] + count
            assert_same_text("\n".join(rows[found[0] : at]), piece)


@pytest.mark.parametrize("promised", ["a 1\n...\nc 3\n", "...\nb 2\n...\n", "a 1\nb 2\nc 3\n"])
def test_pieces_of_a_text_stand_in_it(promised: str) -> None:
    assert_printed("a 1\nb 2\nc 3\n", promised)


@pytest.mark.parametrize(
    "promised", ["a 1\n...\nc 9\n", "...\nb 9\n...\n", "c 3\n...\na 1\n...\n", "b 2\n...\n"]
)
def test_pieces_that_are_not_printed_or_in_another_order_are_seen(promised: str) -> None:
    with pytest.raises(AssertionError):
        assert_printed("a 1\nb 2\nc 3\n", promised)


def run_commands(block: str) -> None:
    """Run `wbc ...` and `python -m sims...`, one per line, as a shell does in this folder."""
    for line in block.splitlines():
        words = []
        for word in shlex.split(line):
            words += sorted(map(str, Path().glob(word))) if "*" in word else [word]
        if words[:2] == ["python", "-m"]:
            runpy.run_module(words[2], run_name="__main__")
        else:
            assert words[0] == "wbc", line
            assert main(words[1:]) == 0, line


@pytest.mark.parametrize("page", PAGES, ids=[str(p.relative_to(ROOT)) for p in PAGES])
def test_blocks_of_a_page_run_and_print_what_it_shows(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    namespace: dict[str, object] = {"__name__": "page"}
    for language, block, promised in BLOCK.findall(page.read_text(encoding="utf-8")):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            if language == "sh":
                run_commands(block)
            else:
                exec(compile(block, str(page), "exec", dont_inherit=True), namespace)
        if promised:
            assert_printed(printed.getvalue(), promised)


@pytest.mark.parametrize("page", PASTED)
def test_blocks_pasted_into_the_prompt_print_what_the_page_shows(page, tmp_path, monkeypatch):
    """The prompt ends a block at an empty line and echoes every value that is not assigned."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.ps1", ">>> ", raising=False)
    prompt = code.InteractiveConsole({"__name__": "__console__"})
    for _, block, promised in BLOCK.findall((ROOT / page).read_text(encoding="utf-8")):
        printed, complaints = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(complaints):
            more = [prompt.push(line) for line in [*block.splitlines(), ""]][-1]
        assert not more, f"the block is not finished by an empty line:\n{block}"
        assert "Error" not in complaints.getvalue(), complaints.getvalue()
        assert_same_text(printed.getvalue(), promised)
