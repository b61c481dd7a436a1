"""What effects and a search for causes tell each other: numbers, logs, and how these depend."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.arrays import BoolArray, FloatArray

if TYPE_CHECKING:
    from wbc.robot.effect import Motion


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


def number(
    unit: str, null: float, low: float, high: float, scale: float, **more: Any
) -> Mapping[str, Any]:
    """Return what makes a field of an effect one of its parameters: `field(metadata=number(...))`.

    Arguments as of `Parameter`, whose name is the field's.
    """
    given = {"unit": unit, "null": null, "low": low, "high": high, "scale": scale, **more}
    return {"parameter": given}


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is known about a set of logs when an effect proposes where to start.

    Attributes:
        motions: one per log, (N, ...) arrays.
        unexplained: one (N, nv) per log: measured minus modelled torque at the coordinates
            [N m, N], driven rows at the motor output.
        reported: one (N, m) per log: torque on the rotors that the drives report [N m].
        currents: (m,) whether all that is known of a drive's torque is the current in its motor;
            None where no drive reports one.
    """

    motions: tuple[Motion, ...]
    unexplained: tuple[FloatArray, ...]
    reported: tuple[FloatArray, ...]
    currents: BoolArray | None = None


@dataclass(frozen=True, eq=False)
class Screen:
    """One linear way in which an effect may explain a residual.

    The regression takes the change that each unit makes to the model's torque as a column, and
    hands the coefficients back: the parameters are `combine(coefficients)`.

    Attributes:
        units: parameter values of the r unit effects.
        combine: (r,) coefficients -> parameter values, possibly outside their bounds.
        expected: coefficient of every unit where the logs do not tell it.
    """

    units: tuple[Mapping[str, float], ...]
    combine: Callable[[FloatArray], dict[str, float]]
    expected: float = 0.0

    @classmethod
    def fixed(cls, values: Mapping[str, float]) -> Screen:
        """Return the screen of an effect that is not linear in any parameter.

        Its size is part of its shape: a coefficient far from one says that the shape is wrong.
        """
        chosen = dict(values)

        def combine(coefficients: FloatArray) -> dict[str, float]:
            fits = 0.4 < float(coefficients[0]) < 2.5
            return chosen if fits else dict.fromkeys(chosen, np.nan)

        return cls((chosen,), combine, expected=1.0)

    @classmethod
    def shapes(
        cls, linear: str, shape: str, tried: Iterable[float], step: float = 1.0
    ) -> tuple[Screen, ...]:
        """Return the screens of an effect with two parameters, one per value of its shape.

        Args:
            linear: name of the parameter in which it is linear.
            shape: name of the other one.
            tried: its values.
            step: the unit of the linear one.
        """

        def screen(value: float) -> Screen:
            unit = {linear: step, shape: value}
            return cls((unit,), lambda c: {linear: step * float(c[0]), shape: value})

        return tuple(screen(float(value)) for value in tried)


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
