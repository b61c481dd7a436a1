"""Studies write into a folder of their own."""

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _own_folder(here: Path) -> None:
    pass
