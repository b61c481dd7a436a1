"""Friction proportional to speed that falls as the motor warms up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen, SearchOffer

_REFERENCE = 40.0  # [deg C], at which ISO 3448 gives the viscosity of lubricants
# Oils and greases halve their viscosity every 12 to 45 K near 40 deg C (ASTM D341 for the
# viscosity indices 0 to 200); a fit goes on between these.
_RATES = (0.015, 0.03, 0.06)  # [1/K]


def _screens(
    kind: type[ThermalViscousFriction], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per usual rate; none where no temperature was logged or it stayed."""
    warmest, coldest = _range(robot, where, evidence.motions)
    if warmest == coldest:
        return ()

    def screen(rate: float) -> Screen:
        unit = {"coefficient": 1.0, "rate": rate}
        return Screen((unit,), lambda c: {"coefficient": float(c[0]), "rate": rate})

    return tuple(screen(rate) for rate in _RATES)


def _recognisable(effect: ThermalViscousFriction, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether the temperature changed: at one temperature this is viscous friction."""
    warmest, coldest = _range(robot, effect.where, motions)
    return warmest > coldest


@final
@dataclass(frozen=True)
class ThermalViscousFriction(JointEffect):
    """A torque -coefficient * exp(-rate (T - 40 deg C)) * v at a joint (Reynolds' viscosity).

    T is the motor's temperature, the column `<joint>.temperature` of a log. Where no temperature
    is known, it is taken for 40 deg C and this is viscous friction.

    Attributes:
        coefficient: [N m s/rad] at 40 deg C, at the joint.
        rate: share of the friction lost per kelvin [1/K].
    """

    coefficient: float
    rate: float

    name = "thermal_viscous_friction"
    parameters = (
        Parameter("coefficient", "N m s/rad", 0.0, 0.0, 10000.0, 0.1),
        Parameter("rate", "1/K", 0.03, 0.0, 0.3, 0.01, shape=True),
    )
    explanation = (
        "Cold lubricant is thick: its drag falls as the gear warms up, by half within about "
        "twenty kelvins."
    )
    experiment = (
        "Repeat one motion at several speeds cold and warm, and log the motor's temperature: the "
        "slope of the torque over the speed falls with temperature."
    )
    search = SearchOffer(
        claims=2,  # friction, and that it falls with temperature
        screens=_screens,
        recognisable=_recognisable,
    )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the torque at the joint, (..., nv) [N m]."""
        drag = self.coefficient * self.joint_velocity(robot, motion)
        if motion.temperature is not None:
            warm = motion.temperature[..., self.gear(robot)] - _REFERENCE
            drag = drag * np.exp(-self.rate * warm)
        return self.on_joint(robot, motion, -drag)


def _range(robot: Robot, where: str, motions: Sequence[Motion]) -> tuple[float, float]:
    """Return the highest and lowest temperature [deg C] of a motor, equal where not all know it."""
    column = robot.transmission.index(where)
    seen = [motion.temperature for motion in motions]
    known = [values[..., column] for values in seen if values is not None]
    if len(known) < len(seen) or not known:
        return _REFERENCE, _REFERENCE
    return max(float(t.max()) for t in known), min(float(t.min()) for t in known)
