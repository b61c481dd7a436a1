"""Metrics that only a simulation gives: what a design does when it drops, stands, lands and hops.

Each has columns for one design; what a design cannot do is NaN, so that a sweep goes on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from wbc.arrays import FloatArray
from wbc.errors import DesignError, SimulationError
from wbc.robot import Robot


@dataclass(frozen=True)
class SimulatedMetric:
    """One simulation and its columns.

    Attributes:
        columns: column -> unit.
        needs: what a robot must be, for the help text.
    """

    columns: Mapping[str, str]
    needs: str


SIMULATIONS: dict[str, SimulatedMetric] = {
    "drop": SimulatedMetric(
        {
            "drop_impulse": "N s",
            "drop_impulse_share": "1",
            "drop_mesh_loss": "J",
            "drop_ground_loss": "J",
        },
        "a base that can fall",
    ),
    "standing": SimulatedMetric(
        {
            "standing_torque": "N m",
            "standing_heat": "W",
            "standing_neutral_torque": "N m",
            "standing_neutral_heat": "W",
        },
        "a planar leg with a point foot",
    ),
    "landing": SimulatedMetric(
        {"landing_error": "m", "landing_error_high": "m", "landing_error_low": "m"},
        "a planar leg with a point foot",
    ),
    "hop": SimulatedMetric(
        {"hop_height": "m", "hop_energy": "J", "hop_cost": "1"},
        "a planar leg with a point foot",
    ),
}


def simulate_design(name: str, robot: Robot, q: FloatArray, contact: str) -> dict[str, float]:
    """Return the columns of one simulation; NaN where the design has no such motion.

    Raises:
        DesignError: a robot of another kind than the simulation needs.
    """
    # Plant and controller are loaded by whoever simulates, not by whoever reads the list.
    from wbc.design.point_leg import PointLeg, height_row
    from wbc.design.simulations import RUNS

    metric = SIMULATIONS[name]
    try:
        return RUNS[name](robot, q, contact)
    except SimulationError:
        return dict.fromkeys(metric.columns, float("nan"))
    except DesignError:
        if name != "drop":
            PointLeg.of(robot, contact)  # raises for a robot of the wrong kind
        height_row(robot)
        return dict.fromkeys(metric.columns, float("nan"))
