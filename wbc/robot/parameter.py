"""The numbers of an effect: their units and ranges, what is usual, what a person can check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot.screening import Screen


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

    def cost(self, value: float) -> float:
        """Return by how much less likely a number is than one in the range [nats]."""
        nearest = min(max(value, self.low), self.high)
        off = float(np.log(value / nearest)) if self.factor else value - nearest
        return 0.5 * (off / self.spread) ** 2


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


@dataclass(frozen=True)
class Quantity:
    """A number of a machine that a person can check.

    Attributes:
        value: in `unit`.
        unit: SI unit.
        instead: beginning of the names of what is said in its place where logs do not tell it.
    """

    value: float
    unit: str
    instead: str = ""


def small_steps(parameters: Sequence[Parameter], null: Mapping[str, float]) -> tuple[Screen, ...]:
    """Return the screen of a small step of every parameter that is no shape, none without any.

    Args:
        parameters: of an effect.
        null: the values with which it changes nothing.
    """
    steps: dict[str, float] = {}
    for parameter in parameters:
        if not parameter.shape:
            step = 1e-3 * parameter.scale
            inside = null[parameter.name] + step <= parameter.high
            steps[parameter.name] = step if inside else -step

    def combine(coefficients: FloatArray) -> dict[str, float]:
        changes = zip(steps.items(), coefficients, strict=True)
        return {**null, **{name: null[name] + float(c) * step for (name, step), c in changes}}

    units = tuple({**null, name: null[name] + step} for name, step in steps.items())
    return (Screen(units, combine),) if units else ()
