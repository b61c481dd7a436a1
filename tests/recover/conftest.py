"""Outside logs with known hidden effects."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.outside import outside


@pytest.fixture(scope="session")
def practice_leg() -> Path:
    return outside("practice_leg")
