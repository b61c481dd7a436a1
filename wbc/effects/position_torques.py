"""Torques that depend on where a joint is: springs, and what repeats with position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, Motion, Robot, Screen, SearchOffer, number

_LEAST_TRAVEL = 5e-3  # [rad or m]
_UNIT = 1e-3  # [N m/rad, N m] so small that it turns no gear's power round


def spring(q: FloatArray, stiffness: float, rest: float) -> FloatArray:
    """Return -stiffness * (q - rest) (...) [N m]."""
    return -stiffness * (q - rest)


def _spring_screens(
    kind: type[JointSpring], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen: springs about the middle and 1 rad beside it span every rest position.

    Far from where the joint moves two such springs are alike but for their size, and folds held out
    tell them apart no better than noise.
    """
    position = robot.position_index(where)
    middle = float(np.mean([np.mean(motion.position[:, position]) for motion in evidence.motions]))

    def combine(coefficients: FloatArray) -> dict[str, float]:
        stiffness = _UNIT * float(np.sum(coefficients))
        aside = _UNIT * float(coefficients[1]) / stiffness if stiffness != 0.0 else 0.0
        return {"stiffness": stiffness, "rest": middle + aside}

    units = tuple({"stiffness": _UNIT, "rest": middle + aside} for aside in (0.0, 1.0))
    return (Screen(units, combine),)


@final
@dataclass(frozen=True)
class JointSpring(JointEffect):
    """A torque -stiffness * (q - rest) at a joint.

    Attributes:
        stiffness: [N m/rad].
        rest: position at which the spring is slack [rad].
    """

    stiffness: float = field(metadata=number("N m/rad", 0.0, 0.0, 100000.0, 1.0))
    rest: float = field(metadata=number("rad", 0.0, -10.0, 10.0, 0.3, shape=True))

    explanation = "A cable loom, a hose or a parallel spring pulls the joint to a rest position."
    experiment = (
        "Hold the joint at several positions over its range with the load taken off: the "
        "torque is a straight line over position."
    )
    search = SearchOffer(
        screens=_spring_screens,
        # At one place a spring is any constant.
        recognisable=lambda own, *seen: bool(np.ptp(own.positions(*seen)) > _LEAST_TRAVEL),
    )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return -stiffness * (q - rest) at the joint, (..., nv) [N m]."""
        q = self.joint_position(robot, motion)
        return self.on_joint(robot, motion, spring(q, self.stiffness, self.rest))


LEAST_PERIODS = 1.0  # a period longer than the range of motion cannot be told from a slope
_WAVE = 0.95 * 2.0 * np.pi * LEAST_PERIODS  # [rad]
_WHOLE = 0.02  # waves per turn of the rotor this close to a whole number are taken for it


def ripple(q: FloatArray, amplitude: float, order: float, phase: float) -> FloatArray:
    """Return amplitude * sin(order * q + phase) (...) [N m]."""
    return amplitude * np.sin(order * q + phase)


def _ripple_screens(
    kind: type[TorqueRipple], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per order at which the unexplained torque repeats with position."""
    position, torque = robot.position_index(where), robot.velocity_index(where)
    positions = [motion.position[:, position] for motion in evidence.motions]
    orders = strongest_orders(positions, [left[:, torque] for left in evidence.unexplained])

    def screen(order: float) -> Screen:
        unit = {"amplitude": _UNIT, "order": order}
        units = tuple({**unit, "phase": phase} for phase in (0.0, 0.5 * np.pi))

        def combine(coefficients: FloatArray) -> dict[str, float]:
            sine, cosine = (_UNIT * float(c) for c in coefficients)
            return {
                "amplitude": float(np.hypot(sine, cosine)),
                "order": order,
                "phase": float(np.arctan2(cosine, sine)),
            }

        return Screen(units, combine)

    return tuple(screen(order) for order in orders)


def _ripple_implausibility(effect: TorqueRipple, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return minus the log of the share of all orders that these motions take for this one.

    A third each of what ripples was made anywhere in a gear, at its output, and at its rotor.
    Anywhere, orders are as likely on any scale (teeth, slots, stages): the density is
    1 / order. A turn of the output holds whole numbers of waves, and so does one of the rotor,
    k = 1, 2, .. (an eccentric rotor, the two lobes of a strain wave, pole pairs); k is as
    likely on any scale, too. Motions tell two waves apart that differ by a period over their
    range: where that is more than a turn of the rotor, all three are one n-th for a wave that
    passed n periods.
    """
    told = 2.0 * np.pi / float(np.ptp(effect.positions(robot, motions)))
    anywhere = told / effect.order
    turns = effect._turns(robot)
    shares = [whole_number_share(effect.order / each, told / each) for each in turns]
    return float(max(-np.log(np.mean([anywhere, *shares])), 0.0))


def _ripple_remarks(effect: TorqueRipple, robot: Robot) -> tuple[str, ...]:
    """Return how many waves there are in a turn of the rotor, if it is a whole number."""
    _, rotor = effect._turns(robot)
    waves = effect.order / rotor
    whole = round(waves)
    if rotor == 1.0 or whole < 1 or abs(waves - whole) > _WHOLE:
        return ()
    return (f"This is {whole} per turn of the rotor.",)


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

    amplitude: float = field(metadata=number("N m", 0.0, 0.0, 10000.0, 0.3))
    order: float = field(metadata=number("1", 1.0, 0.05, 100000.0, 1.0, shape=True))
    phase: float = field(metadata=number("rad", 0.0, -6.3, 6.3, 1.0, shape=True))

    explanation = "Magnets, slots and teeth pass one another: the torque repeats with position."
    experiment = (
        "Turn the joint very slowly and evenly over its range in both directions: the torque "
        "waves with position, the same both ways."
    )
    search = SearchOffer(
        screens=_ripple_screens,
        implausibility=_ripple_implausibility,
        remarks=_ripple_remarks,
        # Of a whole period at most a twentieth may be missing.
        recognisable=lambda own, *seen: bool(own.order * np.ptp(own.positions(*seen)) > _WAVE),
    )

    def _turns(self, robot: Robot) -> tuple[float, float]:
        """Return how often the joint and the rotor turn in a turn of the joint."""
        gears, gear = robot.transmission, robot.transmission.index(self.where)
        return 1.0, float(abs(gears.gear_ratio[gear] * gears.motor_from_joint[gear, gear]))

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return amplitude * sin(order * q + phase) at the joint, (..., nv) [N m]."""
        q = self.joint_position(robot, motion)
        return self.on_joint(robot, motion, ripple(q, self.amplitude, self.order, self.phase))


_BINS = 16384
_CLEAR = 1e-6


def strongest_orders(
    positions: Sequence[FloatArray], torques: Sequence[FloatArray], count: int = 3
) -> list[float]:
    """Return the angular frequencies [1/rad] at which a torque repeats with position.

    Per frequency the least squares of a sine, a cosine and a constant over all samples (a
    Lomb-Scargle periodogram with the mean free), so that neither the order of visits matters nor
    where the joint rested: sums over samples are transforms of histograms over fine bins.

    Args:
        positions, torques: (N,) per log [rad or m, N m or N].
        count: how many peaks to return, strongest first.
    """
    low = min(float(position.min()) for position in positions)
    high = max(float(position.max()) for position in positions)
    span = high - low
    if span <= 0.0:
        return []
    # Zero padding to four times the range places peaks within an eighth of their width.
    length = 4.0 * span
    visits, total = np.zeros(_BINS), np.zeros(_BINS)
    for position, torque in zip(positions, torques, strict=True):
        bins = ((position - low) / length * _BINS).astype(np.int_)
        visits += np.bincount(bins, minlength=_BINS)
        total += np.bincount(bins, torque - torque.mean(), minlength=_BINS)
    power = _explained(visits, total)
    order = 2.0 * np.pi * np.arange(power.size) / length
    # Within one bin a wave must not turn by more than about half a radian.
    usable = (order >= 2.0 * np.pi * LEAST_PERIODS / span) & (order < 0.5 * _BINS / length)
    peak = usable & (power >= np.roll(power, 1)) & (power >= np.roll(power, -1))
    ranked = np.flatnonzero(peak)[np.argsort(power[peak])[::-1]]
    return [float(order[k]) for k in ranked[:count]]


def whole_number_share(order: float, told: float) -> float:
    """Return how likely the whole numbers k near an order are, at 1 / k each.

    From the distance `told` on an order is told from this one; nearer ones count less the farther
    they are. Far above one the result is told / order, the integral over 1 / k.
    """
    whole = np.arange(max(np.ceil(order - told), 1.0), np.floor(order + told) + 1.0)
    near = np.maximum(1.0 - np.abs(whole - order) / told, 0.0)
    return float(np.sum(near / whole))


def _explained(visits: FloatArray, total: FloatArray) -> FloatArray:
    """Return the sum of squares (K,) that a wave of k periods over all bins (B,) explains.

    Each bin holds so many samples, and their sum, zero on the whole.
    """
    count = visits.size // 4
    wave, torque = np.fft.rfft(visits), np.fft.rfft(total)[:count]
    double, single, samples = wave[: 2 * count : 2], wave[:count], float(visits.sum())
    cosine, sine = single.real, -single.imag
    a = 0.5 * (samples + double.real) - cosine**2 / samples
    b = -0.5 * double.imag - cosine * sine / samples
    c = 0.5 * (samples - double.real) - sine**2 / samples
    along, across = torque.real, -torque.imag
    determinant = a * c - b**2
    found = c * along**2 - 2.0 * b * along * across + a * across**2
    # Where two of the three columns are one, the wave is no wave over these bins.
    clear = determinant > _CLEAR * samples**2
    return np.asarray(np.where(clear, found / np.where(clear, determinant, 1.0), 0.0))
