"""A gear that loses a share of the power, differently forward and backward."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

from wbc.effects.joint_effect import JointEffect
from wbc.robot import Parameter, Robot
from wbc.transmission import wedge_backward_efficiency


@final
@dataclass(frozen=True)
class TransmissionEfficiency(JointEffect):
    """The forward and backward efficiency of one gear; they replace the robot's values.

    Attributes:
        forward_efficiency: eta_f, power out / power in when the motor drives.
        backward_efficiency: eta_b when the joint drives; zero or less is self-locking.
    """

    forward_efficiency: float
    backward_efficiency: float

    name: ClassVar[str] = "transmission_efficiency"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("forward_efficiency", "1", 1.0, 0.05, 1.0, 0.1),
        Parameter("backward_efficiency", "1", 1.0, -20.0, 1.5, 0.1),
    )
    explanation: ClassVar[str] = (
        "Sliding teeth lose a share of the power they carry; driving the joint from the motor "
        "and being driven back by the load lose different shares."
    )
    experiment: ClassVar[str] = (
        "Lift and lower several known weights slowly: the lifting torque grows and the "
        "lowering torque shrinks in proportion to the weight."
    )

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the robot's present efficiencies."""
        gears = robot.transmission
        row = gears.index(where)
        return {
            "forward_efficiency": float(gears.forward_efficiency[row]),
            "backward_efficiency": float(gears.backward_efficiency[row]),
        }

    @classmethod
    def wedge(cls, where: str, forward_efficiency: float) -> TransmissionEfficiency:
        """Return the effect with the wedge's eta_b = 2 - 1/eta_f."""
        return cls(where, forward_efficiency, float(wedge_backward_efficiency(forward_efficiency)))

    def change(self, robot: Robot) -> Robot:
        """Return the robot with these efficiencies."""
        gears = robot.transmission
        row = gears.index(self.where)
        forward, backward = gears.forward_efficiency.copy(), gears.backward_efficiency.copy()
        forward[row], backward[row] = self.forward_efficiency, self.backward_efficiency
        return robot.with_transmission(
            gears.replace(forward_efficiency=forward, backward_efficiency=backward)
        )
