"""A gear that loses a share of the power, differently forward and backward."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, Parameter, Robot, Screen, SearchOffer, Usual
from wbc.transmission import wedge_backward_efficiency

# Gears lose from one per cent to half of the power, and some are self-locking, hardly beyond.
_FORWARD, _BACKWARD = Usual(1.0, 1.0, 0.5, factor=True), Usual(1.0, 1.0, 0.7)
_WEDGE = 0.02  # efficiencies this close to the wedge's relation are taken for it


def _screens(
    kind: type[TransmissionEfficiency], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return two screens: the wedge's pair of efficiencies, and both of them free.

    The torque a gear needs is linear in 1/eta_f and eta_b, so losses are the coefficients.
    """
    null = kind.null_values(robot, where)
    forward, backward = null["forward_efficiency"], null["backward_efficiency"]
    step = 1e-3

    def efficiencies(loss: float, backward_loss: float) -> dict[str, float]:
        inverse = 1.0 / forward + step * loss
        return {
            "forward_efficiency": min(1.0 / inverse, 1.0) if inverse > 0.0 else np.inf,
            "backward_efficiency": min(backward - step * backward_loss, 1.0),
        }

    pair = Screen((efficiencies(1.0, 1.0),), lambda c: efficiencies(float(c[0]), float(c[0])))
    free = Screen(
        (efficiencies(1.0, 0.0), efficiencies(0.0, 1.0)),
        lambda c: efficiencies(float(c[0]), float(c[1])),
    )
    return pair, free


def _freedom(effect: TransmissionEfficiency) -> int:
    """One where the wedge's relation between the two efficiencies holds, else two."""
    wedge = float(wedge_backward_efficiency(effect.forward_efficiency))
    return 1 if abs(effect.backward_efficiency - wedge) < _WEDGE else 2


@final
@dataclass(frozen=True)
class TransmissionEfficiency(JointEffect):
    """The forward and backward efficiency of one gear; they replace the robot's values.

    Attributes:
        forward_efficiency: eta_f, power out / power in when the motor drives.
        backward_efficiency: eta_b when the joint drives; zero or less is self-locking. Above one
            the gear would yield more than it takes.
    """

    forward_efficiency: float
    backward_efficiency: float

    name = "transmission_efficiency"
    parameters = (
        Parameter("forward_efficiency", "1", 1.0, 0.05, 1.0, 0.1, usual=_FORWARD),
        Parameter("backward_efficiency", "1", 1.0, -20.0, 1.0, 0.1, usual=_BACKWARD),
    )
    explanation = (
        "Sliding teeth lose a share of the power they carry; driving the joint from the motor "
        "and being driven back by the load lose different shares."
    )
    experiment = (
        "Lift and lower several known weights slowly: the lifting torque grows and the "
        "lowering torque shrinks in proportion to the weight."
    )
    search = SearchOffer(
        # No gear is without losses. In 184 generated logs (seeds 23, 31, 32) all 41 losses under
        # load that were stated are true, at a mean probability of 0.99 with nothing expected.
        expected=1.0,
        screens=_screens,
        freedom=_freedom,
    )

    def said(self, units: Mapping[str, str] | None = None) -> str:
        """Return what the gear loses either way."""
        forward = f"{100.0 * (1.0 - self.forward_efficiency):.2g} % when the motor drives"
        share = f"{100.0 * (1.0 - self.backward_efficiency):.2g} %"
        backward = share if self.backward_efficiency > 0.0 else "all of it, it locks,"
        return f"losses in the gear at {self.where} ({forward}, {backward} when the joint drives)"

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
