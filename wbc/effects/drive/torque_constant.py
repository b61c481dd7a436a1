"""A motor that gives more or less torque than its drive believes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.effects.joint_effect import ScaledDrive
from wbc.robot import Motion, Parameter, Robot, Usual

# Drives are off by ten to thirty per cent; a factor of two and more is a wrong unit or column.
_USUAL = Usual(1.0, 1.0, 0.2, factor=True)


@final
@dataclass(frozen=True)
class TorqueConstant(ScaledDrive):
    """The drive delivers factor times the torque that it reports.

    Attributes:
        factor: delivered / reported torque.
    """

    factor: float

    name = "torque_constant"
    parameters = (Parameter("factor", "1", 1.0, 0.2, 5.0, 0.1, usual=_USUAL),)
    explanation = (
        "The torque constant in the drive is wrong, or the motor saturates: every torque is "
        "off by the same factor, in both directions of power."
    )
    experiment = (
        "Hang a known weight on the joint and hold it still from above and from below: the "
        "mean torque is off by the factor."
    )

    def factor_at(self, robot: Robot, motion: Motion) -> float:
        """Return the factor."""
        return self.factor
