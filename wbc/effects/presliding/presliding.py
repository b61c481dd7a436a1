"""Dry friction that builds up over a small angle after every reversal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.effects.presliding.bristles import energy_of_step, inertia_along, stepped
from wbc.errors import EffectError
from wbc.robot import Evidence, Memory, MemoryEnergy, Motion, Parameter, Robot, Screen, SearchOffer

_SHARES = (0.004, 0.012, 0.035, 0.1, 0.3)  # of the travel; a fit goes on between them
# Lengths after which z is within exp(-3) = 5 % of its end. Where the joint never travels so far the
# bristle never lets go, and acts as a spring does.
TRAVELS = 3.0


def _screens(
    kind: type[Presliding], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per length, from a small share to a third of the travel."""
    travel = travel_of(robot, where, evidence.motions)
    if travel == 0.0:
        return ()

    def screen(length: float) -> Screen:
        unit = {"level": 1.0, "length": length}
        return Screen((unit,), lambda c: {"level": float(c[0]), "length": length})

    return tuple(screen(min(share * travel, 10.0)) for share in _SHARES)


def _recognisable(effect: Presliding, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether z came close to its end (else it is a spring) and was seen on its way there.

    A length that the joint passes between two samples is Coulomb friction.
    """
    steps = [np.abs(np.diff(effect.joint_position(robot, motion))) for motion in motions]
    slow = float(np.median(np.concatenate(steps)))
    travel = travel_of(robot, effect.where, motions)
    return bool(slow < effect.length < travel / TRAVELS)


@final
@dataclass(frozen=True)
class Presliding(JointEffect):
    """Friction -level * z of bristles that bend: dz/dt = (v - |v| z) / length (Dahl's model).

    z lies between -1 and 1. It follows the direction of the motion over `length`; where that goes
    to zero this is Coulomb friction. The bristles store level * length * z^2 / 2 and lose
    level * |v| * z^2: just after a reversal they give energy back.

    A simulator carries z from step to step, from z = 0. Along a log, z follows from the series,
    from z = 0 at its start. Where a single sample is all that is known (a controller), the effect
    acts as its limit, Coulomb friction of the same level.

    Attributes:
        level: [N m], after a long way in one direction.
        length: h [rad], or [m] at a joint that slides: the way over which the friction builds up.
            A length of zero is Coulomb friction.
    """

    level: float
    length: float

    name = "presliding"
    parameters = (
        Parameter("level", "N m", 0.0, 0.0, 10000.0, 0.3),
        Parameter("length", "rad", 0.02, 0.0, 10.0, 0.02, shape=True),
    )
    explanation = (
        "Surfaces in contact, seals and preloaded teeth first bend before they slide: after every "
        "reversal the friction builds up over a small angle."
    )
    experiment = (
        "Move the joint slowly back and forth over ranges from very small to large: the torque "
        "over the position is a loop whose corners are round, the same at every speed."
    )
    search = SearchOffer(screens=_screens, recognisable=_recognisable)

    def first_memory(self, robot: Robot) -> FloatArray:
        """Return z, (1,) or (1, k), of bristles that do not bend."""
        return np.zeros((1, *np.shape(self.level)))

    def next_memory(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return z, (1,) or (1, k), at the end of a step."""
        if motion.memory is None:
            raise EffectError(f"{self.name} at '{self.where}' has no state outside a simulation.")
        return np.array([self._bent(robot, motion, motion.memory)])

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return -level * z at the joint, (..., nv) [N m]; None where z is not known."""
        if motion.memory is not None:
            bent = self._bent(robot, motion, motion.memory)
            return self.on_joint(robot, motion, -self.level * bent)
        if not self._is_series(motion):
            return None
        from wbc.effects.presliding.bristle_series import bent_along  # it loads the compiler

        series = bent_along(self.joint_position(robot, motion), self.length)
        return self.on_joint(robot, motion, -self.level * series)

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return the level (..., nv) [N m] where z is not known: the limit of a short length."""
        if motion.memory is not None or self._is_series(motion):
            return None
        return self.on_joint(robot, motion, self.level)

    def _is_series(self, motion: Motion) -> bool:
        known = motion.time is not None and motion.velocity.ndim == 2
        return known and bool(np.all(np.greater(self.length, 0.0)))

    def memory_energy(self, robot: Robot, motion: Motion) -> MemoryEnergy | None:
        """Return what bristles stored and lost over a step [J]."""
        if motion.memory is None:
            return None
        z, speed = self._bent(robot, motion, motion.memory), self.joint_velocity(robot, motion)
        bent = np.reshape(motion.memory.value[0], z.shape), z
        work = self.level * z * speed * motion.memory.step
        return energy_of_step(bent, (self.level, self.level), self.length, work)

    def _bent(self, robot: Robot, motion: Motion, memory: Memory) -> FloatArray:
        """Return z, () or (k,), at the end of a simulator's step."""

        def inertia() -> FloatArray:
            return inertia_along(robot, motion, np.eye(robot.model.nv)[self.velocity_row(robot)])

        speed = self.joint_velocity(robot, motion)
        return stepped(memory, speed, np.asarray(self.level), self.length, inertia)


def travel_of(robot: Robot, where: str, motions: Sequence[Motion]) -> float:
    """Return the range of positions that a joint passed in one of the motions [rad or m]."""
    row = robot.position_index(where)
    return max(float(np.ptp(motion.position[:, row])) for motion in motions)
