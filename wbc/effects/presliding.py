"""Losses that build up over a small angle after every reversal: bristles that bend (Dahl's model).

dz/dt = (v - |v| z) / length, with z between -1 and 1 in place of the sign of v. The functions take
the bristles of several places at once.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.effects.gear_losses import TransmissionEfficiency
from wbc.effects.joint_effect import JointEffect
from wbc.errors import EffectError
from wbc.robot import Evidence, Memory, MemoryEnergy, Motion, Robot, Screen, SearchOffer, number

# Of the travel; a fit goes on between them. With nothing below 0.004, dry frictions of an arm of
# another simulator, which build up over 0.2 mrad, left four floors, and a plain fit with twenty
# doubtful names was the model to use.
_SHARES = (0.0002, 0.001, 0.004, 0.012, 0.035, 0.1, 0.3)
# Lengths after which z is within exp(-3) = 5 % of its end. Where the joint never travels so far the
# bristle never lets go, and acts as a spring does.
TRAVELS = 3.0
# Of how steps change: a turn's way in three samples, of six that are a period of the filter.
_TURN = 4.5


def _screens(
    kind: type[Presliding], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per length, from a small share to a third of the travel."""
    travel = travel_of(robot, where, evidence.motions)
    tried = np.minimum(np.multiply(_SHARES, travel), 10.0) if travel > 0.0 else ()
    return Screen.shapes("level", "length", tried)


def _recognisable(effect: Bristles, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether z came close to its end (else it is a spring) and was seen on its way there.

    A length that the joint passes in half a period of the filter, as it turns, is Coulomb friction.
    """
    changes = np.concatenate([np.diff(effect.joint_position(robot, m), 2) for m in motions])
    turned = _TURN * float(np.sqrt(np.mean(changes**2)))
    travel = travel_of(robot, effect.where, motions)
    return bool(turned < effect.length < travel / TRAVELS)


class Bristles(JointEffect, ABC):
    """Base of the effects in which z of bristles stands for the sign of a speed: at a joint, here.

    The memory of a simulator holds z, and what else a loss depends on, (1 or 2, k).
    """

    # fields of subclasses; as some of this class they would come before theirs
    length: float
    level: float

    def _way(self, robot: Robot) -> FloatArray:
        """Return how the speed of the surfaces depends on v, (nv,) or (k, nv)."""
        return np.asarray(np.eye(robot.model.nv)[self.velocity_row(robot)])

    def _place(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return how far the surfaces have moved, (...) [rad or m]."""
        return self.joint_position(robot, motion)

    def _levels(self, robot: Robot, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the level (...) [N m] at z = 1 before a simulator's step, and in it."""
        return np.asarray(self.level), np.asarray(self.level)

    def _rubbing(self, robot: Robot, motion: Motion, z: FloatArray) -> FloatArray:
        """Return the torque (...) [N m] that bristles take in a simulator's step."""
        return self.level * z

    def _carried(self, robot: Robot, motion: Motion) -> tuple[FloatArray, ...]:
        """Return what a simulator carries beside z."""
        return ()

    def next_memory(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return z, and what else is carried, at the end of a step, (1 or 2, k).

        Raises:
            EffectError: a motion without memory.
        """
        if motion.memory is None:
            raise EffectError(f"{self.name} at '{self.where}' has no state outside a simulation.")
        z = self._bent(robot, motion, motion.memory)
        return np.array([z, *self._carried(robot, motion)])

    def memory_energy(self, robot: Robot, motion: Motion) -> MemoryEnergy | None:
        """Return where the work went that bristles took over a step [J], all places together.

        They store level * length * z^2 / 2: by bending, and where the level changes under them.
        """
        memory = motion.memory
        if memory is None:
            return None
        z, (level, now) = self._bent(robot, motion, memory), self._levels(robot, motion)
        before = np.reshape(memory.value[0], z.shape)
        speed = self._way(robot) @ motion.velocity
        work = self._rubbing(robot, motion, z) * speed * memory.step
        reloaded = 0.5 * np.multiply(self.length, now - level) * before**2
        bending = 0.5 * np.multiply(self.length, now) * (z**2 - before**2)
        lost = np.maximum(work - bending, 0.0)
        return MemoryEnergy(*(float(np.sum(e)) for e in (bending + reloaded, reloaded, lost)))

    def _is_log(self, motion: Motion) -> bool:
        """Whether z follows from a series; without a length the sign of the speed stands for it."""
        series = motion.time is not None and motion.velocity.ndim == 2
        return series and bool(np.all(np.greater(self.length, 0.0)))

    def _along(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return z along a log, (N,) or (N, k)."""
        from wbc.mechanics.series import bent_along  # it loads the compiler

        return bent_along(self._place(robot, motion), self.length)

    def _bent(self, robot: Robot, motion: Motion, memory: Memory) -> FloatArray:
        """Return z, () or (k,), at the end of a simulator's step.

        dz/dt is solved exactly for the step's speed, so z stays within -1 and 1 for any step. The
        torque is that of this z, so bristles act as a spring of stiffness level / length does in
        semi-implicit Euler: stable up to 4 inertia / step^2. Bristles stiffer than a quarter of
        that are replaced by the stiffest that the step can carry; smaller steps take them back.
        """
        way, (_, level) = self._way(robot), self._levels(robot, motion)
        speed = np.asarray(way @ motion.velocity)
        before = np.reshape(memory.value[0], speed.shape)
        bends = (level != 0.0) & (speed != 0.0)
        if not np.any(bends):
            return before
        stiffest = level * memory.step**2 / inertia_along(robot, motion, way)
        length = np.maximum(np.maximum(self.length, stiffest), np.finfo(np.float64).tiny)
        end = np.sign(speed)
        after = end + (before - end) * np.exp(-np.abs(speed * memory.step) / length)
        return np.where(bends, after, before)


@final
@dataclass(frozen=True)
class Presliding(Bristles):
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

    level: float = field(metadata=number("N m", 0.0, 0.0, 10000.0, 0.3))
    length: float = field(metadata=number("rad", 0.02, 0.0, 10.0, 0.02, shape=True))

    explanation = (
        "Surfaces in contact, seals and preloaded teeth first bend before they slide: after every "
        "reversal the friction builds up over a small angle."
    )
    experiment = (
        "Move the joint slowly back and forth over ranges from very small to large: the torque "
        "over the position is a loop whose corners are round, the same at every speed."
    )
    search = SearchOffer(
        claims=2,  # friction, and that it builds up
        screens=_screens,
        recognisable=_recognisable,
    )

    def first_memory(self, robot: Robot) -> FloatArray:
        """Return z, (1,) or (1, k), of bristles that do not bend."""
        return np.zeros((1, *np.shape(self.level)))

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return -level * z at the joint, (..., nv) [N m]; None where z is not known."""
        if motion.memory is not None:
            z = self._bent(robot, motion, motion.memory)
        elif self._is_log(motion):
            z = self._along(robot, motion)
        else:
            return None
        return self.on_joint(robot, motion, -self.level * z)

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return the level (..., nv) [N m] where z is not known: the limit of a short length."""
        if motion.memory is not None or self._is_log(motion):
            return None
        return self.on_joint(robot, motion, self.level)


def travel_of(robot: Robot, where: str, motions: Sequence[Motion]) -> float:
    """Return the range of positions that a joint passed in one of the motions [rad or m]."""
    row = robot.position_index(where)
    return max(float(np.ptp(motion.position[:, row])) for motion in motions)


_FORWARD, _BACKWARD = (p.usual for p in TransmissionEfficiency.parameters)
_LOAD_SHARES = (0.012, 0.04, 0.13)  # of the travel; a fit goes on between them


def _load_screens(
    kind: type[LoadPresliding], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per length; the torque is linear in 1/eta_f and eta_b."""
    null = kind.null_values(robot, where)
    travel = travel_of(robot, where, evidence.motions)
    if travel == 0.0 or null["backward_efficiency"] <= 0.0:
        return ()
    _, free = TransmissionEfficiency.search.screens(TransmissionEfficiency, robot, where, evidence)
    lengths = [min(share * travel, 10.0) for share in _LOAD_SHARES]

    def screen(length: float) -> Screen:
        units = tuple({**unit, "length": length} for unit in free.units)
        return Screen(units, lambda c: {**free.combine(c), "length": length})

    def bent(length: float) -> Screen:
        values = {**null, "length": length}
        return Screen((values,), lambda _: values)

    lossy = null["forward_efficiency"] < 1.0 or null["backward_efficiency"] < 1.0
    return (*map(screen, lengths), *map(bent, lengths if lossy else ()))


@final
@dataclass(frozen=True)
class LoadPresliding(Bristles):
    """Efficiencies of a gear of which the sign of the speed is replaced by a state z.

    t = T + mean |T| z + difference T z^2,  dz/dt = (w - |w| z) / length,

    with t and T the torques into and out of the mesh and w the speed of its output. At z = +-1
    this is the gear with 1/eta_f = 1 + mean + difference, eta_b = 1 - mean + difference; where the
    length goes to zero it always is (`TransmissionEfficiency`). Bristles hold
    mean |T| length z^2 / 2.

    A simulator carries z from step to step, from z = 0, and solves for T and the loss together;
    in impacts such a gear loses nothing. Along a log, z follows from the series, from z = 0 at its
    start. Where a single sample is all that is known (a controller), the gear has its efficiencies.

    Attributes:
        forward_efficiency: eta_f; replaces the robot's value.
        backward_efficiency: eta_b > 0; likewise.
        length: h [rad] at the gear's output: the way over which the losses build up.
    """

    forward_efficiency: float = field(metadata=number("1", 1.0, 0.05, 1.0, 0.1, usual=_FORWARD))
    backward_efficiency: float = field(metadata=number("1", 1.0, 0.01, 1.0, 0.1, usual=_BACKWARD))
    length: float = field(metadata=number("rad", 0.0, 0.0, 10.0, 0.02, shape=True))

    explanation = (
        "Teeth and rollers under load first bend before they slide: what the gear loses builds up "
        "over a small angle after every reversal, in proportion to the load."
    )
    experiment = (
        "Move the joint slowly back and forth over small and large ranges with two known weights: "
        "the loops of torque over position have round corners and grow with the weight."
    )
    search = SearchOffer(
        claims=2,  # losses, and that they build up
        freedom=lambda own: 1 + TransmissionEfficiency.search.freedom(own._efficiencies),
        screens=_load_screens,
        recognisable=_recognisable,
    )

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the robot's present efficiencies, without a length."""
        return {**TransmissionEfficiency.null_values(robot, where), "length": 0.0}

    def change(self, robot: Robot) -> Robot:
        """Return the robot with these efficiencies, the limit of a short length."""
        return self._efficiencies.change(robot)

    def meshed(
        self, robot: Robot, motion: Motion, output: FloatArray, mesh: FloatArray
    ) -> FloatArray:
        """Return t (..., m) [N m] with this gear's column by z along a log."""
        if not self._is_log(motion):
            return mesh
        z = self._along(robot, motion)
        result, gear = np.array(mesh), self.gear(robot)
        result[:, gear] = output[:, gear] + self._loss(robot, output[:, gear], z)
        return result

    def first_memory(self, robot: Robot) -> FloatArray:
        """Return z of unbent bristles, and the T [N m] that they carry: (2,) or (2, k)."""
        return np.zeros((2, *np.shape(self.length)))

    def rotor_torque(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return what the loss takes from the rotors (m,) in a simulator's step; None elsewhere."""
        if motion.memory is None:
            return None
        loss = self._rubbing(robot, motion, self._bent(robot, motion, motion.memory))
        ratio = robot.transmission.gear_ratio[self.gear(robot)]
        return self.on_rotor(robot, motion, -loss / ratio)

    @property
    def _efficiencies(self) -> TransmissionEfficiency:
        return TransmissionEfficiency(self.where, self.forward_efficiency, self.backward_efficiency)

    def _coefficients(self, robot: Robot) -> tuple[FloatArray, FloatArray]:
        """Return mean and difference, of all that the gear loses."""
        gears, gear = robot.transmission, self.gear(robot)
        inverse, backward = 1.0 / gears.forward_efficiency[gear], gears.backward_efficiency[gear]
        return 0.5 * (inverse - backward), 0.5 * (inverse + backward) - 1.0

    def _loss(self, robot: Robot, load: FloatArray, bent: FloatArray) -> FloatArray:
        """Return t - T (...) [N m] for T and z (...)."""
        mean, difference = self._coefficients(robot)
        return np.asarray(mean * np.abs(load) * bent + difference * load * bent**2)

    def _way(self, robot: Robot) -> FloatArray:
        return np.asarray(robot.motor_rows[self.gear(robot)])

    def _place(self, robot: Robot, motion: Motion) -> FloatArray:
        row = robot.transmission.motor_from_joint[self.gear(robot)]
        return np.asarray(motion.position[:, robot.actuated_position] @ row.T)

    def _carried(self, robot: Robot, motion: Motion) -> tuple[FloatArray, ...]:
        """Return T (...) [N m] during a simulator's step; that of the last one where not solved."""
        if motion.mesh_torque is not None:
            return (np.asarray(motion.mesh_torque[self.gear(robot)]),)
        return (self._before(motion),)

    def _before(self, motion: Motion) -> FloatArray:
        held = np.zeros(2) if motion.memory is None else motion.memory.value
        return np.reshape(held[1], np.shape(self.length))

    def _levels(self, robot: Robot, motion: Motion) -> tuple[FloatArray, FloatArray]:
        mean, _ = self._coefficients(robot)
        (load,) = self._carried(robot, motion)
        return mean * np.abs(self._before(motion)), mean * np.abs(load)

    def _rubbing(self, robot: Robot, motion: Motion, z: FloatArray) -> FloatArray:
        (load,) = self._carried(robot, motion)
        return self._loss(robot, load, z)


def inertia_along(robot: Robot, motion: Motion, direction: FloatArray) -> FloatArray:
    """Return the inertia (...) [kg m^2] that a torque along `direction` (..., nv) accelerates.

    The torque acts alone.
    """
    model, rows = robot.model, robot.motor_rows
    inertia = pin.crba(model, model.createData(), motion.position, pin.Convention.WORLD)
    inertia += rows.T * robot.transmission.reflected_inertia @ rows
    moved = np.linalg.solve(inertia, direction.T).T
    return np.asarray(1.0 / np.sum(direction * moved, axis=-1))
