"""Metrics that only a simulation gives: of a drop, standing, landing, hopping and trotting.

Each has columns for one design; what a design cannot do is NaN, so that a sweep goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from wbc.arrays import FloatArray
from wbc.design.robot_kinds import height_row, require_point_leg, require_quadruped
from wbc.errors import DesignError, SimulationError
from wbc.robot import Robot


@dataclass(frozen=True)
class SimulatedMetric:
    """One simulation and its columns.

    Attributes:
        columns: column -> unit.
        needs: what a robot must be, for the help text.
        require: raises DesignError for a robot of another kind; needs neither plant nor controller.
    """

    columns: Mapping[str, str]
    needs: str
    require: Callable[[Robot], object]


SIMULATIONS: dict[str, SimulatedMetric] = {
    "drop": SimulatedMetric(
        {
            "drop_impulse": "N s",
            "drop_impulse_share": "1",
            "drop_mesh_loss": "J",
            "drop_ground_loss": "J",
        },
        "a base that can fall",
        height_row,
    ),
    "standing": SimulatedMetric(
        {
            "standing_torque": "N m",
            "standing_heat": "W",
            "standing_neutral_torque": "N m",
            "standing_neutral_heat": "W",
        },
        "a planar leg with a point foot",
        require_point_leg,
    ),
    "landing": SimulatedMetric(
        {"landing_error": "m", "landing_error_high": "m", "landing_error_low": "m"},
        "a planar leg with a point foot",
        require_point_leg,
    ),
    "hop": SimulatedMetric(
        {"hop_height": "m", "hop_energy": "J", "hop_cost": "1"},
        "a planar leg with a point foot",
        require_point_leg,
    ),
    "trot": SimulatedMetric(
        {"trot_speed": "m/s", "trot_cost": "1", "trot_work_cost": "1"},
        "a floating base on four feet, one in each corner",
        require_quadruped,
    ),
}


def simulate_design(name: str, robot: Robot, q: FloatArray, contact: str) -> dict[str, float]:
    """Return the columns of one simulation; NaN where the design has no such motion.

    Raises:
        DesignError: a robot of another kind than the simulation needs.
    """
    metric = SIMULATIONS[name]
    metric.require(robot)
    # Plant and controller are loaded by whoever simulates, not by whoever reads the list.
    from wbc.design.simulations import RUNS

    try:
        return RUNS[name](robot, q, contact)
    except (SimulationError, DesignError):
        return dict.fromkeys(metric.columns, float("nan"))
