"""What it takes to hold a force still: torque and heat that stiction saves, and what breaks it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, frozen
from wbc.errors import DynamicsError
from wbc.metrics.force_capability import force_capability
from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class Holding:
    """Rotor torques that hold a force on a contact point at rest.

    At rest a mesh bears T for any input torque in [eta_b T, T/eta_f], and the rotor's dry friction
    widens that interval. The weight of the links is not counted.

    Attributes:
        joints: names of the gears.
        lossless: |T|/N (m,) [N m], with perfect gears.
        least: (m,) [N m], the least torque that holds; 0 where the gear locks itself.
        most: (m,) [N m], the torque above which the gear starts to lift.
        heat_lossless: Joule heat [W] of `lossless`; NaN where a motor's constants are unknown.
        heat_least: Joule heat [W] of `least`; NaN likewise.
        heat_saved: share of the heat that stiction saves, 0 to 1. Where the motors' constants are
            unknown all motors count as equal.
    """

    joints: tuple[str, ...]
    lossless: FloatArray
    least: FloatArray
    most: FloatArray
    heat_lossless: float
    heat_least: float
    heat_saved: float


def holding(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    direction: ArrayLike,
    load: float,
    axes: str = "xyz",
) -> Holding:
    """Return what holding a force of `load` [N] along `direction` asks of the motors.

    Args:
        robot: fixed or floating base; on a floating base the force is taken as given, whether or
            not the robot could balance on it.
        position: q (nq,).
        contact: name of the contact point.
        direction: (n,) along `axes`, of the force on the point.
        load: its size [N], >= 0.
        axes: world axes, for example "xz".

    Raises:
        DynamicsError: axes that do not exist, a negative load.
    """
    if not 0.0 <= load < np.inf:
        raise DynamicsError(f"load must be >= 0 and finite, got {load}.")
    reach = force_capability(robot, position, contact, axes)
    gears = robot.transmission
    output = np.zeros(gears.size)
    output[list(reach.gears)] = load * (reach.torque_from_force @ reach.task.direction(direction))
    ratio, friction = np.abs(gears.gear_ratio), gears.rotor_coulomb_friction
    perfect = np.abs(output) / ratio
    eased = np.abs(output) * np.maximum(gears.backward_efficiency, 0.0) / ratio - friction
    least = np.maximum(eased, 0.0)
    copper = gears.copper_loss
    known = bool(np.isfinite(copper).all())
    weight = copper if known else np.ones(gears.size)
    spent, rest = float(weight @ perfect**2), float(weight @ least**2)
    return Holding(
        joints=gears.joints,
        lossless=frozen(perfect),
        least=frozen(least),
        most=frozen(np.abs(output) / gears.forward_efficiency / ratio + friction),
        heat_lossless=spent if known else float("nan"),
        heat_least=rest if known else float("nan"),
        heat_saved=1.0 - rest / spent if spent > 0.0 else 0.0,
    )


def backdriving_torque(robot: Robot) -> FloatArray:
    """Return the torque (m,) [N m] at each motor output that turns an unpowered gear.

    N tau_c / eta_b with the rotor's dry friction tau_c: 0 without it, infinite for a self-locking
    gear.
    """
    gears = robot.transmission
    safe = np.where(gears.self_locking, 1.0, gears.backward_efficiency)
    torque = np.abs(gears.gear_ratio) * gears.rotor_coulomb_friction / safe
    return frozen(np.where(gears.self_locking, np.inf, torque))


def backdriving_force(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    direction: ArrayLike,
    axes: str = "xyz",
) -> float:
    """Return the force [N] along `direction` at which the first unpowered gear gives way.

    Args:
        robot: fixed or floating base.
        position: q (nq,).
        contact: name of the contact point.
        direction: (n,) along `axes`.
        axes: world axes, for example "xz".

    Raises:
        DynamicsError: a direction in which the structure bears the force without any torque.
    """
    reach = force_capability(robot, position, contact, axes)
    lever = reach.levers(direction)
    limits = backdriving_torque(robot)[list(reach.gears)]
    loaded = lever > 0.0
    return float(np.min(limits[loaded] / lever[loaded]))
