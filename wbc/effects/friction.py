"""Friction of bearings, seals and grease at a joint, or at a motor that several joints turn."""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import GearNumbers, JointEffect, offer_near_rest, range_of
from wbc.errors import EffectError, require_known
from wbc.robot import Evidence, Motion, Robot, Screen, SearchOffer, number
from wbc.transmission import stribeck


def viscous(v: FloatArray, coefficient: float) -> FloatArray:
    """Return -coefficient * v (...) [N m]."""
    return -coefficient * v


@final
@dataclass(frozen=True)
class ViscousFriction(JointEffect):
    """A torque -coefficient * v at a joint.

    Attributes:
        coefficient: [N m s/rad], at the joint.
    """

    coefficient: float = field(metadata=number("N m s/rad", 0.0, 0.0, 10000.0, 0.1))

    needs_drive = False
    explanation = "Bearings and gears shear lubricant: the loss grows in proportion to speed."
    experiment = (
        "Move the joint at several constant speeds in both directions, slow to fast: the "
        "extra torque lies on a straight line through zero."
    )
    search = SearchOffer(expected=2.0)

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return -coefficient * v at the joint, (..., nv) [N m]."""
        speed = self.joint_velocity(robot, motion)
        return self.on_joint(robot, motion, viscous(speed, self.coefficient))


def directional(v: FloatArray, positive: float, negative: float) -> FloatArray:
    """Return -positive * v (...) [N m] where v > 0 and -negative * v where v < 0."""
    return -(positive * np.maximum(v, 0.0) + negative * np.minimum(v, 0.0))


@final
@dataclass(frozen=True)
class DirectionalViscousFriction(JointEffect):
    """A torque -positive_direction * v at a joint for v > 0 and -negative_direction * v for v < 0.

    With both equal it is viscous friction.

    Attributes:
        positive_direction, negative_direction: [N m s/rad], at the joint.
    """

    positive_direction: float = field(metadata=number("N m s/rad", 0.0, 0.0, 10000.0, 0.1))
    negative_direction: float = field(metadata=number("N m s/rad", 0.0, 0.0, 10000.0, 0.1))

    explanation = (
        "Lip seals, spindles and lubricant that is pumped one way drag more in one direction of "
        "motion than in the other."
    )
    experiment = (
        "Move the joint at several constant speeds in both directions: the extra torque lies on "
        "two straight lines through zero, one per direction, of different slope."
    )
    search = SearchOffer(
        claims=2,  # friction, and that it differs by direction
        # In one direction alone this is viscous friction.
        recognisable=lambda own, *seen: bool(np.ptp(np.sign(own.speeds(*seen))) == 2.0),
    )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the torque at the joint, (..., nv) [N m]."""
        v = self.joint_velocity(robot, motion)
        drag = directional(v, self.positive_direction, self.negative_direction)
        return self.on_joint(robot, motion, drag)


_REFERENCE = 40.0  # [deg C], at which ISO 3448 gives the viscosity of lubricants
# Oils and greases halve their viscosity every 12 to 45 K near 40 deg C (ASTM D341 for the
# viscosity indices 0 to 200); a fit goes on between these.
_RATES = (0.015, 0.03, 0.06)  # [1/K]


def _thermal_screens(
    kind: type[ThermalViscousFriction], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per usual rate; none where no temperature was logged or it stayed."""
    changed = _thermal_recognisable(kind.at(where), robot, evidence.motions)
    return Screen.shapes("coefficient", "rate", _RATES if changed else ())


def _thermal_recognisable(
    effect: ThermalViscousFriction, robot: Robot, motions: Sequence[Motion]
) -> bool:
    """Whether the temperature changed: at one temperature this is viscous friction."""
    coldest, warmest = range_of(robot, effect.where, (motion.temperature for motion in motions))
    return bool(warmest > coldest)


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

    coefficient: float = field(metadata=number("N m s/rad", 0.0, 0.0, 10000.0, 0.1))
    rate: float = field(metadata=number("1/K", 0.03, 0.0, 0.3, 0.01, shape=True))

    explanation = "Cold lubricant is thick: its drag halves as the gear warms by twenty kelvins."
    experiment = (
        "Repeat one motion at several speeds cold and warm, and log the motor's temperature: the "
        "slope of the torque over the speed falls with temperature."
    )
    search = SearchOffer(
        claims=2,  # friction, and that it falls with temperature
        screens=_thermal_screens,
        recognisable=_thermal_recognisable,
    )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the torque at the joint, (..., nv) [N m]."""
        drag = self.coefficient * self.joint_velocity(robot, motion)
        if motion.temperature is not None:
            warm = motion.temperature[..., self.gear(robot)] - _REFERENCE
            drag = drag * np.exp(-self.rate * warm)
        return self.on_joint(robot, motion, -drag)


def quadratic(v: FloatArray, coefficient: float) -> FloatArray:
    """Return -coefficient * |v| v (...) [N m]."""
    return -coefficient * np.abs(v) * v


@final
@dataclass(frozen=True)
class QuadraticDrag(JointEffect):
    """A torque -coefficient * |v| v at a joint.

    Attributes:
        coefficient: [N m s^2/rad^2], at the joint.
    """

    coefficient: float = field(metadata=number("N m s^2/rad^2", 0.0, 0.0, 10000.0, 0.05))

    explanation = "Air or churned oil is thrown aside: the loss grows with the square of speed."
    experiment = (
        "Move the joint at several constant speeds up to the fastest: torque over speed rises "
        "in a straight line instead of being constant."
    )

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return -coefficient * |v| v at the joint, (..., nv) [N m]."""
        speed = self.joint_velocity(robot, motion)
        return self.on_joint(robot, motion, quadratic(speed, self.coefficient))


@final
@dataclass(frozen=True)
class CoulombFriction(JointEffect):
    """Dry friction at a joint: -level * sgn(v), anything between at rest.

    Attributes:
        level: [N m], at the joint.
    """

    level: float = field(metadata=number("N m", 0.0, 0.0, 10000.0, 0.3))

    needs_drive = False
    explanation = "Surfaces rub: a torque of constant size opposes any motion, and holds at rest."
    experiment = (
        "Move the joint slowly back and forth through the same positions: the torque of the "
        "two directions differs by a constant, whatever the load."
    )
    search = SearchOffer(expected=2.0)

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the level at the joint, (..., nv) [N m]."""
        return self.on_joint(robot, motion, self.level)


@final
@dataclass(frozen=True)
class StribeckFriction(JointEffect):
    """Extra dry friction near rest: level * exp(-(v/speed)^2) (Armstrong's form, exponent 2).

    It comes on top of Coulomb friction, which it exceeds only below a few times `speed`.

    Attributes:
        level: [N m] at zero speed, at the joint.
        speed: Stribeck speed [rad/s].
    """

    level: float = field(metadata=number("N m", 0.0, 0.0, 10000.0, 0.3))
    speed: float = field(metadata=number("rad/s", 0.1, 0.001, 20.0, 0.1, shape=True))

    explanation = "At low speed the film of lubricant breaks: friction falls as speed rises."
    experiment = (
        "Move the joint through standstill very slowly, then at growing speeds: the torque "
        "first falls with speed, then rises."
    )
    search = offer_near_rest("level", np.geomspace(0.08, 0.8, 6))

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the level at the present speed, (..., nv) [N m]."""
        speed = self.joint_velocity(robot, motion)
        return self.on_joint(robot, motion, stribeck(speed, self.level, self.speed))


@dataclass(frozen=True)
class RotorFriction(GearNumbers, ABC):
    """Base of the effects whose place is a motor: before its gear, not at the joint behind it.

    Where a motor turns with its joint alone and its gear loses nothing, what happens at the motor
    cannot be told from what happens at the joint, and the effects of the joint stand for both. A
    torque sensor behind the gear tells the two apart. So does a gear with losses under load: what
    rubs at the motor does not load it.
    """

    experiment = (
        "Where joints share the motor, move them against one another so that it stands still: what "
        "drags or rubs at the motor falls away. Else lift and lower weights, slowly and at several "
        "speeds: friction behind the gear adds to the load that the gear loses a share of."
    )
    search = SearchOffer(expected=2.0)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every gear that a topology couples, that has losses, or a sensor, by its joint's name."""
        gears = robot.transmission
        told = np.count_nonzero(gears.motor_from_joint, axis=1) > 1
        told |= (gears.forward_efficiency != 1.0) | (gears.backward_efficiency != 1.0)
        told[robot.sensed] = True
        return tuple(joint for joint, yes in zip(gears.joints, told, strict=True) if yes)

    def check_place(self, robot: Robot) -> None:
        """Raise EffectError unless `where` is a driven joint.

        A robot keeps what its sensors showed when it is used without them.
        """
        joints = robot.transmission.joints
        require_known(EffectError, f"place for {self.name}", self.where, joints)


@final
@dataclass(frozen=True)
class RotorViscousFriction(RotorFriction):
    """Friction in proportion to the motor's speed: -coefficient psi_dot at the motor's output.

    Attributes:
        coefficient: [N m s/rad], at the motor output (N^2 times that on the rotor); replaces the
            robot's value.
    """

    coefficient: float = field(metadata=number("N m s/rad", 0.0, 0.0, 10000.0, 0.1))

    numbers = (("coefficient", "rotor_viscous_friction", 2),)
    explanation = (
        "Grease is sheared on the motor's side of the gear: a torque grows with the speed of the "
        "motor, and does not load the gear."
    )
    search = replace(RotorFriction.search, otherwise=ViscousFriction)


@final
@dataclass(frozen=True)
class RotorCoulombFriction(RotorFriction):
    """Dry friction that follows the motor's speed: -level sgn(psi_dot) at the motor's output.

    Attributes:
        level: [N m], at the motor output (N times that on the rotor); replaces the robot's value.
    """

    level: float = field(metadata=number("N m", 0.0, 0.0, 10000.0, 0.3))

    numbers = (("level", "rotor_coulomb_friction", 1),)
    explanation = (
        "Seals and bearings rub on the motor's side of the gear: the torque changes sign with the "
        "speed of the motor, and does not load the gear."
    )
    search = replace(RotorFriction.search, otherwise=CoulombFriction)
