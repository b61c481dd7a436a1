"""Dropping the unpowered leg: the impact, and the impact mitigation that drops show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc import Robot
from wbc.sim import Impact, Plant

_BLOCKED = 1e9  # [kg m^2], a rotor that no impact moves


def drop(robot: Robot, height: float) -> Impact:
    """Return the impact of the unpowered leg, dropped from `height` [m] in the paper's pose."""
    plant, q = Plant(robot), robot.pose("paper")
    q[robot.position_index("base_z")] += height
    state, rest = plant.state(q), np.zeros(robot.transmission.size)
    while True:
        result = plant.step(state, rest, 5e-3)
        if result.impacts:
            return result.impacts[0]
        state = result.state


def mitigation(robot: Robot, height: float) -> float:
    """Return the impact mitigation factor that drops on frictionless ground show."""
    smooth = replace(robot, contacts=tuple(replace(c, friction=0.0) for c in robot.contacts))
    rotors = np.full(robot.transmission.size, _BLOCKED)
    blocked = smooth.with_transmission(robot.transmission.replace(rotor_inertia=rotors))
    give, rigid = (drop(leg, height).contact_impulse[0, 2] for leg in (smooth, blocked))
    return float(1.0 - give / rigid)
