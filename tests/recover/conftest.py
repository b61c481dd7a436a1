"""Outside logs with known hidden effects."""

from __future__ import annotations

from pathlib import Path

import pytest

PRACTICE = Path(__file__).parents[2].parent / "shared" / "data" / "practice_leg"


@pytest.fixture(scope="session")
def practice_leg() -> Path:
    if not PRACTICE.is_dir():
        pytest.skip(f"the practice logs are not at {PRACTICE}")
    return PRACTICE
