"""How an effect offers itself to a linear regression before its parameters are known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.robot.motion import Motion


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
        options: attributes of the effect that are no parameters.
        expected: coefficient of every unit where the logs do not tell it.
    """

    units: tuple[Mapping[str, float], ...]
    combine: Callable[[FloatArray], dict[str, float]]
    options: Mapping[str, str] = field(default_factory=dict)
    expected: float = 0.0

    @classmethod
    def fixed(cls, values: Mapping[str, float], **options: str) -> Screen:
        """Return the screen of an effect that is not linear in any parameter.

        Its size is part of its shape: a coefficient far from one says that the shape is wrong.
        """
        chosen = dict(values)

        def combine(coefficients: FloatArray) -> dict[str, float]:
            fits = 0.4 < float(coefficients[0]) < 2.5
            return chosen if fits else dict.fromkeys(chosen, np.nan)

        return cls((chosen,), combine, options, expected=1.0)
