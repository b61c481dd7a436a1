"""The plant: convex time steps with gears, ground contact and impacts; recordings are logs.

Names are loaded when they are first used: whoever reads logs or draws a ground does not wait for
the compiled loops of the plant.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wbc.sim.closed_loop import (
        ClosedLoop,
        LoopTick,
        SensorNoise,
        TorqueLag,
        with_wrong_efficiencies,
    )
    from wbc.sim.energy.audit import EnergyAudit
    from wbc.sim.energy.energy_flow import EnergyFlow
    from wbc.sim.ground.box import Box
    from wbc.sim.ground.height_field import HeightField
    from wbc.sim.ground.moving import Moving
    from wbc.sim.ground.plane import Plane
    from wbc.sim.ground.sphere import Sphere
    from wbc.sim.ground.stairs import Stairs
    from wbc.sim.ground.terrain import Terrain, Together
    from wbc.sim.laws.elements import Elements
    from wbc.sim.plant import Plant
    from wbc.sim.recorder import Recorder
    from wbc.sim.sensors.sensor import Sensor
    from wbc.sim.sensors.sensor_model import SensorModel
    from wbc.sim.simulation import Simulation, simulate
    from wbc.sim.solve.residuals import Residuals
    from wbc.sim.solve.solution import StepSolution
    from wbc.sim.solve.solver import solve_program
    from wbc.sim.state import SimState
    from wbc.sim.step.events import StepEvent
    from wbc.sim.step.impact import Impact
    from wbc.sim.step.program import StepProgram, Unilateral
    from wbc.sim.step.step_result import StepResult

__all__ = [
    "Box",
    "ClosedLoop",
    "Elements",
    "EnergyAudit",
    "EnergyFlow",
    "HeightField",
    "Impact",
    "LoopTick",
    "Moving",
    "Plane",
    "Plant",
    "Recorder",
    "Residuals",
    "Sensor",
    "SensorModel",
    "SensorNoise",
    "SimState",
    "Simulation",
    "Sphere",
    "Stairs",
    "StepEvent",
    "StepProgram",
    "StepResult",
    "StepSolution",
    "Terrain",
    "Together",
    "TorqueLag",
    "Unilateral",
    "simulate",
    "solve_program",
    "with_wrong_efficiencies",
]

_HOMES = {
    "closed_loop": (
        "ClosedLoop",
        "LoopTick",
        "SensorNoise",
        "TorqueLag",
        "with_wrong_efficiencies",
    ),
    "energy.audit": ("EnergyAudit",),
    "energy.energy_flow": ("EnergyFlow",),
    "ground.box": ("Box",),
    "ground.height_field": ("HeightField",),
    "ground.moving": ("Moving",),
    "ground.plane": ("Plane",),
    "ground.sphere": ("Sphere",),
    "ground.stairs": ("Stairs",),
    "ground.terrain": ("Terrain", "Together"),
    "laws.elements": ("Elements",),
    "plant": ("Plant",),
    "recorder": ("Recorder",),
    "sensors.sensor": ("Sensor",),
    "sensors.sensor_model": ("SensorModel",),
    "simulation": ("Simulation", "simulate"),
    "solve.residuals": ("Residuals",),
    "solve.solution": ("StepSolution",),
    "solve.solver": ("solve_program",),
    "state": ("SimState",),
    "step.events": ("StepEvent",),
    "step.impact": ("Impact",),
    "step.program": ("StepProgram", "Unilateral"),
    "step.step_result": ("StepResult",),
}


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"wbc.sim.{home}"), name)
    raise AttributeError(f"module 'wbc.sim' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__
