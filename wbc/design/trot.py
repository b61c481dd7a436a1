"""What a trot costs: the simulated metric of quadrupeds."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.design.point_leg import placed, total_mass
from wbc.design.trotter import Trotter
from wbc.robot import Robot
from wbc.sim import Plant

_TICK = 1e-3  # [s]
_SETTLE, _MEASURED = 4, 4  # periods of the gait before the cost is taken, and over which it is
_FALLEN = 0.5  # share of its height at which the base has fallen


def trot(robot: Robot, q: FloatArray, contact: str) -> dict[str, float]:
    """Return speed and cost of transport of a trot whose controller knows the gears.

    The work is that of the motors that drive; what the others would give back is lost. The cost is
    work over m g and the way, `trot_cost` with the Joule heat of the windings (NaN without
    resistance and torque constant), `trot_work_cost` without it. Both are NaN, and the speed is 0,
    for a design that falls.
    """
    pose = placed(robot, q, 0.0)
    trotter, plant = Trotter(robot, pose), Plant(robot)
    settled = round((trotter.start + _SETTLE * trotter.period) / _TICK)
    measured = round(_MEASURED * trotter.period / _TICK)
    gears, state = robot.transmission, plant.state(pose)
    work = heat = begin = 0.0
    for tick in range(settled + measured):
        if tick == settled:
            begin, work, heat = float(state.position[0]), 0.0, 0.0
        result = plant.step(state, trotter(state), _TICK)
        speed = 0.5 * (state.velocity + result.state.velocity)[robot.actuated]
        power = result.rotor_torque * gears.gear_ratio * (gears.motor_from_joint @ speed)
        loss = gears.copper_loss * result.rotor_torque**2
        work += float(np.maximum(power, 0.0).sum()) * _TICK
        heat += float(np.maximum(power + loss, 0.0).sum()) * _TICK
        state = result.state
        if state.position[2] < _FALLEN * pose[2]:
            return {"trot_speed": 0.0, "trot_cost": np.nan, "trot_work_cost": np.nan}
    way = float(state.position[0]) - begin
    carried = total_mass(robot) * 9.81 * way
    moves = way > 0.0
    return {
        "trot_speed": way / (measured * _TICK),
        "trot_cost": heat / carried if moves else np.nan,
        "trot_work_cost": work / carried if moves else np.nan,
    }
