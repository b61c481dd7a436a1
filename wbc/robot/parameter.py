"""The numbers of an effect: their units and ranges, and what is usual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Usual:
    """How the numbers of machines spread: a density that is flat and falls off at both ends.

    Attributes:
        low, high: range that machines usually have.
        spread: standard deviation of what lies outside it, of the logarithm if `factor`.
        factor: whether numbers are compared by their ratio.
    """

    low: float
    high: float
    spread: float
    factor: bool = False

    def departure(self, value: float) -> float:
        """Return how many standard deviations a number lies outside the range."""
        nearest = min(max(value, self.low), self.high)
        off = float(np.log(value / nearest)) if self.factor else value - nearest
        return off / self.spread

    def cost(self, value: float) -> float:
        """Return by how much less likely a number is than one in the range [nats]."""
        return 0.5 * self.departure(value) ** 2


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Attributes:
        name: attribute of the effect that holds it.
        unit: SI unit, "1" for a pure number.
        null: value at which the effect is not there.
        low, high: bounds that physics allows and a fit searches.
        scale: a typical size, also the step of finite differences times 1e-4.
        shape: True if it only shapes the effect (a frequency, a rest angle) and has no null.
        doubt: share of the number that its model is off by, however long the logs are.
        usual: what machines have of it, None where any size is as likely.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    scale: float
    shape: bool = False
    doubt: float = 0.0
    usual: Usual | None = None
