"""Every Python block of the README and the docs runs, one page after another in one namespace.

A block of text right below a block of Python is what the page says is printed. Words must be the
same, numbers within a tenth: libraries and processors round differently, and a page is no
regression test, but it must not promise what does not happen.
"""

from __future__ import annotations

import code
import contextlib
import io
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# These run line by line, as at the prompt.
PASTED = ("README.md", "docs/guide/tutorial.md", "docs/guide/tutorial-logs.md")
PAGES = [
    path
    for path in sorted((ROOT / "docs").rglob("*.md"))
    if "_build" not in path.parts and str(path.relative_to(ROOT)) not in PASTED
]
BLOCK = re.compile(r"^```python\n(.*?)^```$(?:\n+^```text\n(.*?)^```$)?", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def assert_same_text(printed: str, promised: str) -> None:
    """Check that words are equal and numbers within a tenth (or 0.02 near zero)."""
    assert NUMBER.sub("#", printed).split() == NUMBER.sub("#", promised).split(), printed
    found = [float(x) for x in NUMBER.findall(printed)]
    expected = [float(x) for x in NUMBER.findall(promised)]
    assert found == pytest.approx(expected, rel=0.1, abs=0.02), printed


@pytest.mark.parametrize("page", PAGES, ids=[str(p.relative_to(ROOT)) for p in PAGES])
def test_python_blocks_of_a_page_run_and_print_what_it_shows(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    namespace: dict[str, object] = {"__name__": "page"}
    for block, promised in BLOCK.findall(page.read_text(encoding="utf-8")):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(block, str(page), "exec", dont_inherit=True), namespace)
        if promised:
            assert_same_text(printed.getvalue(), promised)


@pytest.mark.parametrize("page", PASTED)
def test_blocks_pasted_into_the_prompt_print_what_the_page_shows(page, tmp_path, monkeypatch):
    """The prompt ends a block at an empty line and echoes every value that is not assigned."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.ps1", ">>> ", raising=False)
    prompt = code.InteractiveConsole({"__name__": "__console__"})
    for block, promised in BLOCK.findall((ROOT / page).read_text(encoding="utf-8")):
        printed, complaints = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(complaints):
            more = [prompt.push(line) for line in [*block.splitlines(), ""]][-1]
        assert not more, f"the block is not finished by an empty line:\n{block}"
        assert "Error" not in complaints.getvalue(), complaints.getvalue()
        assert_same_text(printed.getvalue(), promised)
