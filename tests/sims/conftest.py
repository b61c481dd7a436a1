"""The folder of studies."""

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _own_folder(here: Path) -> None:
    """Studies write where they run."""
