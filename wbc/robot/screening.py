"""How an effect offers itself to a linear regression before its parameters are known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from wbc.arrays import FloatArray
from wbc.robot.motion import Motion


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is known about a set of logs when an effect proposes where to start.

    Attributes:
        motions: one per log, (N, ...) arrays.
        unexplained: one (N, nv) per log: measured minus modelled torque at the coordinates
            [N m, N], driven rows at the motor output.
    """

    motions: tuple[Motion, ...]
    unexplained: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class Screen:
    """One linear way in which an effect may explain a residual.

    The regression takes the change that each unit makes to the model's torque as a column, and
    hands the coefficients back: the parameters are `combine(coefficients)`.

    Attributes:
        units: parameter values of the r unit effects.
        combine: (r,) coefficients -> parameter values, possibly outside their bounds.
    """

    units: tuple[Mapping[str, float], ...]
    combine: Callable[[FloatArray], dict[str, float]]
