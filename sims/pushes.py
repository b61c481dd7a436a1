"""Pushing the foot of a leg that hangs weightless from a fixed base, until it gives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.dynamics import evaluate
from wbc.sim import Plane, Plant

FREE = Plane(height=-10.0)
_FRICTION = 0.02  # [N m] of each rotor, assumed
_STRONGEST = 1e5  # [N], a push that is not tried any more


def hanging_leg() -> Robot:
    """Return the fixed leg of the paper, weightless, with friction in its rotors."""
    robot = load_robot("planar_leg_fixed").with_gravity([0.0, 0.0, 0.0])
    friction = np.full(robot.transmission.size, _FRICTION)
    return robot.with_transmission(robot.transmission.replace(rotor_coulomb_friction=friction))


def torque_of(robot: Robot, push: FloatArray, q: FloatArray) -> FloatArray:
    """Return the joint torque (m,) that a push (3,) [N] on the foot is in the pose q."""
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    return np.asarray(terms.contact_jacobian[:3].T @ push)


def acceleration(plant: Plant, push: FloatArray, powered: bool) -> float:
    """Return how fast the foot gives way along a push (3,) [N] from rest [m/s^2]."""
    robot, q = plant.robot, plant.robot.pose("paper")
    torque = torque_of(robot, push, q)
    motor = -torque / robot.transmission.gear_ratio if powered else np.zeros(len(torque))
    step = 1e-4
    after = plant.step(plant.state(q), motor, step, torque).state
    return float(torque @ after.velocity / np.linalg.norm(push) / step)


def force_to_move(robot: Robot, direction: Sequence[float], powered: bool) -> float:
    """Return the least push [N] along `direction` that moves the foot; infinite for none."""
    low, high, plant = 0.0, _STRONGEST, Plant(robot, FREE)
    unit = np.array(direction) / np.linalg.norm(direction)
    if acceleration(plant, high * unit, powered) < 1e-6:
        return np.inf
    while high - low > 1e-6 * high:
        middle = 0.5 * (low + high) if low > 1.0 else np.sqrt(max(low, 1e-3) * high)
        moves = acceleration(plant, middle * unit, powered) > 1e-6
        low, high = (low, middle) if moves else (middle, high)
    return high
