"""Effects that sit at a driven joint."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, IntArray
from wbc.robot import Effect, Evidence, Motion, Robot, Screen, SearchOffer


class Rows(NamedTuple):
    """Where the joints of an effect with several places stand in the arrays of a robot.

    Attributes:
        position: entries of q (k,).
        velocity: rows of v (k,).
        gear: numbers of the gears (k,).
    """

    position: IntArray
    velocity: IntArray
    gear: IntArray


@dataclass(frozen=True)
class JointEffect(Effect, ABC):
    """Base of the effects whose place is one joint.

    A controller or a simulator asks all effects of a kind at once (`wbc.effects.tables`). Then
    the parameters are arrays (k,), one number per place, and the methods below take and return
    arrays with these k places as last axis.

    Attributes:
        needs_drive: whether the place is a driven joint; else passive joints are places, too.
        rows: of all its places, None for an effect at one place.
    """

    needs_drive = True
    rows: ClassVar[Rows | None] = None

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every driven joint, and every passive one where the effect needs no drive."""
        driven = robot.transmission.joints
        return driven if cls.needs_drive else (*driven, *robot.passive_joints)

    def gear(self, robot: Robot) -> int | IntArray:
        """Return the number of this gear, (k,) for several places."""
        return robot.transmission.index(self.where) if self.rows is None else self.rows.gear

    def position_row(self, robot: Robot) -> int | IntArray:
        """Return this joint's entry of q, (k,) for several places."""
        return robot.position_index(self.where) if self.rows is None else self.rows.position

    def velocity_row(self, robot: Robot) -> int | IntArray:
        """Return this joint's row of v, (k,) for several places."""
        return robot.velocity_index(self.where) if self.rows is None else self.rows.velocity

    def joint_position(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return this joint's position, (...) [rad or m]."""
        return np.asarray(motion.position[..., self.position_row(robot)])

    def joint_velocity(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return this joint's velocity, (...) [rad/s or m/s]."""
        return np.asarray(motion.velocity[..., self.velocity_row(robot)])

    def positions(self, robot: Robot, motions: Iterable[Motion]) -> FloatArray:
        """Return this joint's positions in some motions, one after the other, (...)."""
        return np.concatenate([self.joint_position(robot, motion) for motion in motions])

    def speeds(self, robot: Robot, motions: Iterable[Motion]) -> FloatArray:
        """Return this joint's velocities in some motions, one after the other, (...)."""
        return np.concatenate([self.joint_velocity(robot, motion) for motion in motions])

    def on_joint(self, robot: Robot, motion: Motion, torque: ArrayLike) -> FloatArray:
        """Return `torque` (...) at this joint's row of a (..., nv) array of zeros."""
        result = np.zeros(motion.velocity.shape)
        result[..., self.velocity_row(robot)] = torque
        return result

    def on_rotor(self, robot: Robot, motion: Motion, torque: ArrayLike) -> FloatArray:
        """Return `torque` (...) at this gear's column of a (..., m) array of zeros."""
        result = np.zeros((*motion.velocity.shape[:-1], robot.transmission.size))
        result[..., self.gear(robot)] = torque
        return result


@dataclass(frozen=True)
class ScaledDrive(JointEffect, ABC):
    """Base of the effects after which a drive delivers another torque by a factor."""

    @abstractmethod
    def factor_at(self, robot: Robot, motion: Motion) -> ArrayLike:
        """Return delivered over reported torque of this gear, (...) or one number."""

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque delivered for a reported one, (..., m)."""
        return torque * self._factors(robot, motion)

    def drive_inverse(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque reported for a delivered one, (..., m)."""
        return torque / self._factors(robot, motion)

    def _factors(self, robot: Robot, motion: Motion) -> FloatArray:
        gear, factor = self.gear(robot), np.asarray(self.factor_at(robot, motion))
        samples = factor.shape if np.ndim(gear) == 0 else factor.shape[:-1]
        factors = np.ones((*samples, robot.transmission.size))
        factors[..., gear] = factor
        return factors


@dataclass(frozen=True)
class GearNumbers(JointEffect, ABC):
    """Base of the effects that replace numbers of a gear, as they are at the motor's output.

    Attributes:
        numbers: of each parameter that is not called and measured as in the transmission its name,
            the attribute there, and the power of |N| by which it is larger at the output.
    """

    numbers: ClassVar[tuple[tuple[str, str, int], ...]] = ()

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every driven joint whose gear is known."""
        return tuple(j for j in robot.transmission.joints if j not in robot.sensor_only)

    @classmethod
    def _of_gear(cls, robot: Robot, where: str) -> dict[str, tuple[str, float]]:
        """Return parameter -> attribute of the transmission, and how much larger it is here."""
        ratio = abs(float(robot.transmission.gear_ratio[robot.transmission.index(where)]))
        same = {p.name: (p.name, 1.0) for p in cls.parameters}
        return same | {own: (name, ratio**power) for own, name, power in cls.numbers}

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the robot's present numbers."""
        gears, gear = robot.transmission, robot.transmission.index(where)
        known = cls._of_gear(robot, where).items()
        return {own: float(getattr(gears, name)[gear] * more) for own, (name, more) in known}

    def change(self, robot: Robot) -> Robot:
        """Return the robot with these numbers."""
        known = self._of_gear(robot, self.where).items()
        numbers = {name: getattr(self, own) / more for own, (name, more) in known}
        return robot.with_transmission(robot.transmission.with_values(self.where, numbers))


def range_of(robot: Robot, where: str, values: Iterable[FloatArray | None]) -> FloatArray:
    """Return lowest and highest of values (N, m) per log at a gear; NaN where a log has none."""
    gear = robot.transmission.index(where)
    own = np.concatenate([[np.nan] if v is None else v[..., gear] for v in values])
    return np.array([np.min(own), np.max(own)])


def offer_near_rest(linear: str, shares: ArrayLike, **more: Any) -> SearchOffer:
    """Return what a search asks of an effect that fades beyond its parameter `speed`.

    Args:
        linear: name of its other parameter.
        shares: of the usual speed, each tried as a `speed`; a fit goes on between them.
        more: fields of the offer.
    """

    def screens(
        kind: type[JointEffect], robot: Robot, where: str, evidence: Evidence
    ) -> tuple[Screen, ...]:
        usual = float(np.sqrt(np.mean(kind.at(where).speeds(robot, evidence.motions) ** 2)))
        tried = np.clip(np.multiply(shares, usual), 0.001, 20.0) if usual > 0.0 else ()
        return Screen.shapes(linear, "speed", tried)

    return SearchOffer(
        near_rest=True,
        screens=screens,
        # Below twice this speed it never fades.
        recognisable=lambda own, *seen: bool(2.0 * own.speed < np.abs(own.speeds(*seen)).max()),
        **more,
    )
