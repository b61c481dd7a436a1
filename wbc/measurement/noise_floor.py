"""What noise a channel carries, and how that is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class NoiseFloor:
    """Standard deviation of the noise of each channel.

    Attributes:
        level: channel -> standard deviation, in its unit.
        pairs: how many pairs of repeats it was taken from; 0 for none.
        groups: indices of the logs that repeat each other.
    """

    level: Mapping[str, float]
    pairs: int
    groups: tuple[tuple[int, ...], ...]

    @property
    def is_lower_bound(self) -> bool:
        """Whether there were no repeats, so that slow noise is missing from the levels."""
        return self.pairs == 0

    @property
    def label(self) -> str:
        """How reports call it."""
        if self.is_lower_bound:
            return "lower bound (no repeats: high-frequency content alone)"
        return f"from {self.pairs} pair{'s' if self.pairs > 1 else ''} of repeats"
