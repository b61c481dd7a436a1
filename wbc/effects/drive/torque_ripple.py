"""Torque that repeats with position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.drive.periodicity import (
    LEAST_PERIODS,
    strongest_orders,
    whole_number_share,
)
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen, SearchOffer

_WHOLE = 0.02  # waves per turn of the rotor this close to a whole number are taken for it


def torque(q: FloatArray, amplitude: float, order: float, phase: float) -> FloatArray:
    """Return amplitude * sin(order * q + phase) (...) [N m]."""
    return amplitude * np.sin(order * q + phase)


def _screens(
    kind: type[TorqueRipple], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per order at which the unexplained torque repeats with position."""
    position, torque = robot.position_index(where), robot.velocity_index(where)
    orders = strongest_orders(
        [motion.position[:, position] for motion in evidence.motions],
        [unexplained[:, torque] for unexplained in evidence.unexplained],
    )

    def screen(order: float) -> Screen:
        units = tuple(
            {"amplitude": 1.0, "order": order, "phase": phase} for phase in (0.0, 0.5 * np.pi)
        )

        def combine(coefficients: FloatArray) -> dict[str, float]:
            sine, cosine = (float(c) for c in coefficients)
            return {
                "amplitude": float(np.hypot(sine, cosine)),
                "order": order,
                "phase": float(np.arctan2(cosine, sine)),
            }

        return Screen(units, combine)

    return tuple(screen(order) for order in orders)


def _implausibility(effect: TorqueRipple, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return minus the log of the share of all orders that these motions take for this one.

    A third each of what ripples was made anywhere in a gear, at its output, and at its rotor.
    Anywhere, orders are as likely on any scale (teeth, slots, stages): the density is
    1 / order. A turn of the output holds whole numbers of waves, and so does one of the rotor,
    k = 1, 2, .. (an eccentric rotor, the two lobes of a strain wave, pole pairs); k is as
    likely on any scale, too. Motions tell two waves apart that differ by a period over their
    range: where that is more than a turn of the rotor, all three are one n-th for a wave that
    passed n periods.
    """
    told = 2.0 * np.pi / effect._span(robot, motions)
    anywhere = told / effect.order
    shares = [
        whole_number_share(effect.order / turns, told / turns) for turns in effect._turns(robot)
    ]
    return float(max(-np.log(np.mean([anywhere, *shares])), 0.0))


def _remarks(effect: TorqueRipple, robot: Robot) -> tuple[str, ...]:
    """Return how many waves there are in a turn of the rotor, if it is a whole number."""
    _, rotor = effect._turns(robot)
    waves = effect.order / rotor
    whole = round(waves)
    if rotor == 1.0 or whole < 1 or abs(waves - whole) > _WHOLE:
        return ()
    return (f"This is {whole} per turn of the rotor.",)


def _recognisable(effect: TorqueRipple, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether the joint passed a whole period, within a twentieth."""
    return effect.order * effect._span(robot, motions) > 0.95 * 2.0 * np.pi * LEAST_PERIODS


@final
@dataclass(frozen=True)
class TorqueRipple(JointEffect):
    """A torque periodic in position, amplitude * sin(order * q + phase), given at the joint.

    Attributes:
        amplitude: [N m], at the joint.
        order: periods per turn of the joint (a slot or tooth count times the ratio; not always a
            whole number).
        phase: [rad].
    """

    amplitude: float
    order: float
    phase: float

    name = "torque_ripple"
    parameters = (
        Parameter("amplitude", "N m", 0.0, 0.0, 10000.0, 0.3),
        Parameter("order", "1", 1.0, 0.05, 100000.0, 1.0, shape=True),
        Parameter("phase", "rad", 0.0, -6.3, 6.3, 1.0, shape=True),
    )
    explanation = (
        "Magnets, slots and teeth pass one another: the torque repeats with every pole, slot, "
        "tooth or turn."
    )
    experiment = (
        "Turn the joint very slowly and evenly over its range in both directions: the torque "
        "waves with position, the same both ways."
    )
    search = SearchOffer(
        screens=_screens,
        implausibility=_implausibility,
        remarks=_remarks,
        recognisable=_recognisable,
    )

    def _turns(self, robot: Robot) -> tuple[float, float]:
        """Return how often the joint and the rotor turn in a turn of the joint."""
        gears, gear = robot.transmission, robot.transmission.index(self.where)
        return 1.0, float(abs(gears.gear_ratio[gear] * gears.motor_from_joint[gear, gear]))

    def _span(self, robot: Robot, motions: Sequence[Motion]) -> float:
        positions = [self.joint_position(robot, motion) for motion in motions]
        return max(float(p.max()) for p in positions) - min(float(p.min()) for p in positions)

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return amplitude * sin(order * q + phase) at the joint, (..., nv) [N m]."""
        q = self.joint_position(robot, motion)
        return self.on_joint(robot, motion, torque(q, self.amplitude, self.order, self.phase))
