"""A drive whose torque follows the voltage of its supply."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import ScaledDrive
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen, SearchOffer, Usual

# A drive that sets the duty of a winding follows its supply fully, one that regulates the current
# not at all; poor regulation lies between.
_FOLLOWS = Usual(0.0, 1.0, 0.1)
_LEAST = 0.05  # share of the torque that is left, however far the supply falls


def _screens(
    kind: type[VoltageScaling], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return the screens of nominal voltages; none where the voltage stayed or was not logged.

    The torque is linear in 1 - share and share / nominal, so two screens span them all: one
    at the middle of what was logged, and one at the robot's own voltage.
    """
    lowest, highest = _range(robot, where, evidence.motions)
    if lowest == highest:
        return ()
    described = float(robot.transmission.supply_voltage[robot.transmission.index(where)])
    nominals = [0.5 * (lowest + highest), highest]
    if np.isfinite(described):
        nominals.append(described)

    def screen(nominal: float) -> Screen:
        unit = {"share": 1e-2, "nominal": nominal}
        return Screen((unit,), lambda c: {"share": 1e-2 * float(c[0]), "nominal": nominal})

    return tuple(screen(float(np.clip(u, 1.0, 1000.0))) for u in dict.fromkeys(nominals))


def _recognisable(effect: VoltageScaling, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether the voltage changed: at one voltage this is a wrong torque constant."""
    lowest, highest = _range(robot, effect.where, motions)
    return highest > lowest


@final
@dataclass(frozen=True)
class VoltageScaling(ScaledDrive):
    """The drive delivers 1 + share * (U / nominal - 1) times the torque that it reports.

    U is the supply's voltage, the column `<joint>.voltage` of a log. Where none was logged it is
    the robot's `supply_voltage`; where that is unknown, too, U is the nominal one.

    Attributes:
        share: how far the torque follows the supply: 1 fully, 0 not at all.
        nominal: supply [V] at which the drive delivers what it reports.
    """

    share: float
    nominal: float

    name = "voltage_scaling"
    parameters = (
        Parameter("share", "1", 0.0, 0.0, 2.0, 0.1, usual=_FOLLOWS),
        Parameter("nominal", "V", 24.0, 1.0, 1000.0, 1.0, shape=True),
    )
    explanation = (
        "The drive turns torque into a share of the supply's voltage and takes that voltage for "
        "constant: on a battery that runs down it delivers less than it reports."
    )
    experiment = (
        "Repeat one motion at two supply voltages, such as a full and a nearly empty battery, and "
        "log the voltage: the torque is off by the ratio of the two."
    )
    search = SearchOffer(
        claims=2,  # a torque that is off, and that it follows the supply
        screens=_screens,
        recognisable=_recognisable,
    )

    def factor_at(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the share of the torque that is left, (...)."""
        gear = self.gear(robot)
        voltage = np.asarray(robot.transmission.supply_voltage[gear])
        if motion.supply_voltage is not None:
            voltage = motion.supply_voltage[..., gear]
        known = np.where(np.isfinite(voltage), voltage, self.nominal)
        return np.maximum(1.0 + self.share * (known / self.nominal - 1.0), _LEAST)


def _range(robot: Robot, where: str, motions: Sequence[Motion]) -> tuple[float, float]:
    """Return the lowest and highest voltage [V] at a drive, equal where not all logs know it."""
    column = robot.transmission.index(where)
    known = [m.supply_voltage[..., column] for m in motions if m.supply_voltage is not None]
    if len(known) < len(motions) or not known:
        return 0.0, 0.0
    lowest, highest = min(float(u.min()) for u in known), max(float(u.max()) for u in known)
    return (lowest, highest) if np.isfinite(lowest + highest) and lowest > 0.0 else (0.0, 0.0)
