"""A gear whose losses build up over a small angle after every reversal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.gear.transmission_efficiency import TransmissionEfficiency
from wbc.effects.joint_effect import JointEffect
from wbc.effects.presliding.bristles import energy_of_step, inertia_along, stepped
from wbc.effects.presliding.presliding import TRAVELS, travel_of
from wbc.errors import EffectError
from wbc.robot import Evidence, Memory, MemoryEnergy, Motion, Parameter, Robot, Screen, SearchOffer

_FORWARD, _BACKWARD = (p.usual for p in TransmissionEfficiency.parameters)
_SHARES = (0.012, 0.04, 0.13)  # of the travel; a fit goes on between them


def _freedom(effect: LoadPresliding) -> int:
    """The length, and the numbers that the efficiencies are."""
    return 1 + TransmissionEfficiency.search.freedom(effect._efficiencies)


def _screens(
    kind: type[LoadPresliding], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per length; the torque is linear in 1/eta_f and eta_b."""
    null = kind.null_values(robot, where)
    travel = travel_of(robot, where, evidence.motions)
    if travel == 0.0 or null["backward_efficiency"] <= 0.0:
        return ()
    _, free = TransmissionEfficiency.search.screens(TransmissionEfficiency, robot, where, evidence)
    lengths = [min(share * travel, 10.0) for share in _SHARES]

    def screen(length: float) -> Screen:
        units = tuple({**unit, "length": length} for unit in free.units)
        return Screen(units, lambda c: {**free.combine(c), "length": length})

    found = [screen(length) for length in lengths]
    if null["forward_efficiency"] < 1.0 or null["backward_efficiency"] < 1.0:
        bent = [{**null, "length": length} for length in lengths]
        found += [Screen((values,), lambda _, values=values: values) for values in bent]  # type: ignore[misc]
    return tuple(found)


def _recognisable(effect: LoadPresliding, robot: Robot, motions: Sequence[Motion]) -> bool:
    """Whether z came close to its end and was seen on its way there."""
    steps = [np.abs(np.diff(effect.joint_position(robot, motion))) for motion in motions]
    slow = float(np.median(np.concatenate(steps)))
    return bool(slow < effect.length < travel_of(robot, effect.where, motions) / TRAVELS)


@final
@dataclass(frozen=True)
class LoadPresliding(JointEffect):
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

    forward_efficiency: float
    backward_efficiency: float
    length: float

    name = "load_presliding"
    parameters = (
        Parameter("forward_efficiency", "1", 1.0, 0.05, 1.0, 0.1, usual=_FORWARD),
        Parameter("backward_efficiency", "1", 1.0, 0.01, 1.0, 0.1, usual=_BACKWARD),
        Parameter("length", "rad", 0.0, 0.0, 10.0, 0.02, shape=True),
    )
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
        freedom=_freedom,
        screens=_screens,
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
        if motion.time is None or motion.velocity.ndim != 2 or np.all(self.length == 0.0):
            return mesh
        gear = self.gear(robot)
        turned = motion.position[:, robot.actuated_position] @ self._row(robot).T
        from wbc.effects.presliding.bristle_series import bent_along  # it loads the compiler

        series = bent_along(turned, self.length)
        result = np.array(mesh)
        result[:, gear] = output[:, gear] + self._loss(robot, output[:, gear], series)
        return result

    def first_memory(self, robot: Robot) -> FloatArray:
        """Return z of unbent bristles, and the T [N m] that they carry: (2,) or (2, k)."""
        return np.zeros((2, *np.shape(self.length)))

    def next_memory(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return z and T, (2,) or (2, k), at the end of a step."""
        if motion.memory is None:
            raise EffectError(f"{self.name} at '{self.where}' has no state outside a simulation.")
        return np.array(self._stepped(robot, motion, motion.memory))

    def rotor_torque(self, robot: Robot, motion: Motion) -> FloatArray | None:
        """Return what the loss takes from the rotors (m,) in a simulator's step; None elsewhere."""
        if motion.memory is None:
            return None
        z, load = self._stepped(robot, motion, motion.memory)
        ratio = robot.transmission.gear_ratio[self.gear(robot)]
        return self.on_rotor(robot, motion, -self._loss(robot, load, z) / ratio)

    def memory_energy(self, robot: Robot, motion: Motion) -> MemoryEnergy | None:
        """Return what bristles stored and lost over a step [J]."""
        memory = motion.memory
        if memory is None:
            return None
        z, load = self._stepped(robot, motion, memory)
        work = self._loss(robot, load, z) * self._speed(robot, motion) * memory.step
        mean, _ = self._coefficients(robot)
        before, earlier = (np.reshape(row, z.shape) for row in memory.value)
        levels = mean * np.abs(earlier), mean * np.abs(load)
        return energy_of_step((before, z), levels, self.length, work)

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

    def _row(self, robot: Robot) -> FloatArray:
        """Return (m,) or (k, m) how the gear's output turns with the driven joints."""
        return np.asarray(robot.transmission.motor_from_joint[self.gear(robot)])

    def _speed(self, robot: Robot, motion: Motion) -> FloatArray:
        return np.asarray(self._row(robot) @ motion.velocity[robot.actuated])

    def _stepped(
        self, robot: Robot, motion: Motion, memory: Memory
    ) -> tuple[FloatArray, FloatArray]:
        """Return z, () or (k,), at the end of a simulator's step, and T [N m] during it."""
        speed = self._speed(robot, motion)
        load = np.reshape(memory.value[1], speed.shape)
        if motion.mesh_torque is not None:
            load = np.asarray(motion.mesh_torque[self.gear(robot)])
        mean, _ = self._coefficients(robot)

        def inertia() -> FloatArray:
            direction = np.zeros((*speed.shape, robot.model.nv))
            direction[..., robot.actuated] = self._row(robot)
            return inertia_along(robot, motion, direction)

        return stepped(memory, speed, mean * np.abs(load), self.length, inertia), load
