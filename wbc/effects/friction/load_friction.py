"""Friction proportional to the load that passes through the gear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.effects.gear.transmission_efficiency import TransmissionEfficiency
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Parameter, Robot, SearchOffer


@final
@dataclass(frozen=True)
class LoadFriction(JointEffect):
    """A friction torque coefficient * |T| sgn(v) that the transmitted torque itself causes.

    With t the mesh input: T v > 0 gives T = (1 - c) t, T v < 0 gives T = (1 + c) t, that is
    eta_f (1 - c) and eta_b / (1 + c): the pair that the paper prints for the wedge.

    Attributes:
        coefficient: c, between 0 and 1.
    """

    coefficient: float

    name = "load_friction"
    parameters = (Parameter("coefficient", "1", 0.0, 0.0, 0.95, 0.1),)
    explanation = (
        "Bearings and teeth pressed by the load rub in proportion to it: the loss grows with "
        "the torque carried, equally in both directions."
    )
    experiment = (
        "Lift and lower several known weights slowly: the difference between lifting and "
        "lowering torque grows with the weight."
    )
    search = SearchOffer(
        expected=TransmissionEfficiency.search.expected,
        inseparable={
            "transmission_efficiency": (
                "Load friction c predicts the same as the efficiencies 1 - c (forward) and "
                "1 / (1 + c) (backward): if the fitted ones are these two, no run tells them "
                "apart, and you can use either."
            )
        },
    )

    def change(self, robot: Robot) -> Robot:
        """Return the robot whose gear loses the share of the load as well."""
        gears = robot.transmission
        row = gears.index(self.where)
        forward, backward = np.array(gears.forward_efficiency), np.array(gears.backward_efficiency)
        forward[row] *= 1.0 - self.coefficient
        backward[row] /= 1.0 + self.coefficient
        return robot.with_transmission(
            gears.replace(forward_efficiency=forward, backward_efficiency=backward)
        )
