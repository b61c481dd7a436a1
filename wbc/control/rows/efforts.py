"""Efforts: what should be small about torques and forces, where tasks leave a choice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from wbc.arrays import FloatArray, require_ranges
from wbc.errors import ControlError
from wbc.robot import Robot, state_gear


@dataclass(frozen=True, eq=False, kw_only=True)
class Effort:
    """Something about the gears' torques that should be small; subclasses are final and frozen.

    Where the robot has more ways to move or to push than its tasks decide, efforts choose among
    them; weights small against those of the tasks leave the tasks alone.

    It costs 1/2 sum w y^2 over the gears, where y is N tau_phi = e T + what the rotor takes itself,
    with e the slope of the mesh law in the predicted direction, or T.

    Attributes:
        name: how messages call it.
        weight: >= 0.
    """

    name: str
    weight: float

    of_rotors: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the weight."""
        require_ranges(self, f"effort '{self.name}': ", ControlError, weight=">= 0 and < inf")

    def weights(self, robot: Robot) -> FloatArray:
        """Return w (m,); what a mesh loses is multiplied with |e - 1| |dpsi| / |T_0| as well."""
        return np.full(robot.transmission.size, self.weight)

    @property
    def kind(self) -> tuple[float, float]:
        """What the tick reads besides: 1 where y is N tau_phi, and a least torque, see PROGRAM."""
        return float(self.of_rotors), 0.0


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class JouleHeatEffort(Effort):
    """weight sum R (tau_phi / k_t)^2 [W], the heat of all windings."""

    name: str = "joule_heat"

    of_rotors: ClassVar[bool] = True

    def weights(self, robot: Robot) -> FloatArray:
        """Return the weights of R (N tau_phi / (N k_t))^2.

        Raises:
            ControlError: a motor lacks its resistance or torque constant.
        """
        gears = robot.transmission
        for number in ("torque_constant", "resistance"):
            unknown = np.flatnonzero(np.isnan(getattr(gears, number)))
            if unknown.size:
                joint = gears.joints[int(unknown[0])]
                raise ControlError(
                    f"effort '{self.name}': the motor of '{joint}' has no "
                    f"{number}. Use RotorTorqueEffort, or {state_gear(joint, number)}"
                )
        scale = gears.resistance / (gears.torque_constant * gears.gear_ratio) ** 2
        return np.asarray(2.0 * self.weight * scale)


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
        require_ranges(self, f"effort '{self.name}': ", ControlError, least_torque="> 0 N m")

    @property
    def kind(self) -> tuple[float, float]:
        """The least torque, too."""
        return 0.0, self.least_torque


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class OutputTorqueEffort(Effort):
    """weight/2 sum T^2 [(N m)^2], the torque that leaves each gear (joint torque where D = 1)."""

    name: str = "output_torque"


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class RotorTorqueEffort(Effort):
    """weight/2 sum tau_phi^2 [(N m)^2], losses and rotor inertia included."""

    name: str = "rotor_torque"
    of_rotors: ClassVar[bool] = True

    def weights(self, robot: Robot) -> FloatArray:
        """Return the weights of N tau_phi."""
        return np.asarray(self.weight / robot.transmission.gear_ratio**2)
