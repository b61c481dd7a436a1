"""Efforts: what should be small about torques and forces, where tasks leave a choice."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, final

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import ControlError
from wbc.robot import Robot, state_gear


class GearCost(NamedTuple):
    """A cost 1/2 sum weight (slope T + rotor share)^2 over the gears.

    Attributes:
        weight: (..., m) >= 0.
        slope: (..., m) on the output torque T.
        rotor: 1 to add what the rotor itself takes (inertia, friction), 0 not to.
    """

    weight: FloatArray
    slope: FloatArray
    rotor: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Effort(ABC):
    """Something about the gears' torques that should be small; subclasses are final and frozen.

    Where the robot has more ways to move or to push than its tasks decide, efforts choose among
    them; weights small against those of the tasks leave the tasks alone.

    Attributes:
        name: how messages call it.
        weight: >= 0.
    """

    name: str
    weight: float

    needs: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        """Check the weight."""
        if not 0.0 <= self.weight < np.inf:
            raise ControlError(f"effort '{self.name}': weight must be >= 0, got {self.weight}.")

    def check(self, robot: Robot) -> None:
        """Raise ControlError where a motor lacks one of the numbers that the effort needs."""
        gears = robot.transmission
        for number in self.needs:
            unknown = np.flatnonzero(np.isnan(getattr(gears, number)))
            if unknown.size:
                joint = gears.joints[int(unknown[0])]
                raise ControlError(
                    f"effort '{self.name}': the motor of '{joint}' has no "
                    f"{number}. Use RotorTorqueEffort, or {state_gear(joint, number)}"
                )

    @abstractmethod
    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the quadratic cost of this tick.

        Args:
            robot: the robot.
            slope: e (..., m), mesh input per output torque in the predicted directions.
            speed: expected dpsi (m,) [rad/s].
            last_output: T (m,) of the last tick [N m].
        """


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class JouleHeatEffort(Effort):
    """weight sum R (tau_phi / k_t)^2 [W], the heat of all windings."""

    name: str = "joule_heat"

    needs: ClassVar[tuple[str, ...]] = ("torque_constant", "resistance")

    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the cost of R (tau_phi / k_t)^2 with tau_phi = (e T + rotor share)/N."""
        gears = robot.transmission
        scale = gears.resistance / (gears.torque_constant * gears.gear_ratio) ** 2
        return GearCost(2.0 * self.weight * scale, slope, 1.0)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class MeshLossEffort(Effort):
    """weight sum (t - T) dpsi [W], what the meshes turn into heat.

    The loss is |e - 1| |dpsi| |T|; its absolute value is majorised by a parabola through the last
    tick's torque, |T| <= T^2/(2 |T_0|) + |T_0|/2, which ticks that follow one another closely
    turn into the absolute value itself.

    Attributes:
        least_torque: [N m] under which |T_0| is not taken, so that the parabola stays finite.
    """

    name: str = "mesh_loss"
    least_torque: float = 0.5

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if not self.least_torque > 0.0:
            raise ControlError(f"effort '{self.name}': least_torque must be > 0 N m.")

    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the parabola that touches the loss at the last tick's torque."""
        rate = np.abs(slope - 1.0) * np.abs(speed)
        size = np.maximum(np.abs(last_output), self.least_torque)
        return GearCost(self.weight * rate / size, np.ones(slope.shape), 0.0)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class OutputTorqueEffort(Effort):
    """weight/2 sum T^2 [(N m)^2], the torque that leaves each gear (joint torque where D = 1)."""

    name: str = "output_torque"

    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the cost of T."""
        return GearCost(np.full(slope.shape, self.weight), np.ones(slope.shape), 0.0)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class RotorTorqueEffort(Effort):
    """weight/2 sum tau_phi^2 [(N m)^2], losses and rotor inertia included."""

    name: str = "rotor_torque"

    def cost(
        self, robot: Robot, slope: FloatArray, speed: FloatArray, last_output: FloatArray
    ) -> GearCost:
        """Return the cost of tau_phi = (e T + rotor share)/N."""
        ratio = robot.transmission.gear_ratio
        return GearCost(self.weight / ratio / ratio, slope, 1.0)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class ContactForceTask:
    """weight/2 |f - f_ref|^2 on the force of one contact.

    `Reference.position` is f_ref: (3,) [N] in world axes for a point, (6,) [N, N m] in its frame
    for a surface. Without a reference, or while the contact is not active, the task is idle.

    Attributes:
        name: how references call it.
        contact: name of the contact.
        weight: >= 0, one number or one per component [1/N^2].
    """

    name: str
    contact: str
    weight: float | FloatArray = 1e-4

    def __post_init__(self) -> None:
        """Check the weight."""
        weight = np.asarray(self.weight, dtype=np.float64)
        if not np.isfinite(weight).all() or (weight < 0.0).any():
            raise ControlError(f"task '{self.name}': weight must be >= 0, got {self.weight}.")
