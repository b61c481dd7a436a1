"""Settings of every test, and commands that run in it."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

from wbc.cli import main

# A gate must say the same of the same commit; the search for new cases goes on at every desk.
settings.register_profile("gate", derandomize=True, print_blob=True)
if os.environ.get("CI"):
    settings.load_profile("gate")

Told = Callable[..., str]


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Told:
    """Run a command that must end with a code (0); return what it printed, on one line."""

    def run(*words: object, code: int = 0) -> str:
        found = main([str(word) for word in words])
        said = " ".join("".join(capsys.readouterr()).split())
        assert found == code, said
        return said

    return run


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty folder, in which the test runs."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
