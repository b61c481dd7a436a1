"""Two checkouts of this library timed in turns."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.sim_before import HERE, side_by_side


def test_a_checkout_beside_itself_ends_where_it_does() -> None:
    """The same code in two processes gives the same bits, and every tick of each has a time."""
    times, ends = side_by_side(HERE, rounds=1, ticks=3)
    assert times.shape == (1, 2, 3, 2)
    assert times.min() > 0.0
    assert (ends[0] == ends[1]).all()


def test_a_folder_without_the_library_is_named(tmp_path: Path) -> None:
    """It would else time whatever wbc is installed."""
    with pytest.raises(FileNotFoundError, match=str(tmp_path)):
        side_by_side(tmp_path, rounds=1)
