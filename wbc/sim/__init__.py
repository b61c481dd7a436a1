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
    from wbc.sim.energy import EnergyAudit, EnergyFlow
    from wbc.sim.ground import Box, Plane, Sphere, Stairs, Terrain, Together
    from wbc.sim.height_field import HeightField
    from wbc.sim.plant import HuntCrossley, Plant
    from wbc.sim.recorder import Recorder
    from wbc.sim.result import StepEvent, StepResult
    from wbc.sim.sensors import Sensor, SensorModel
    from wbc.sim.simulation import Simulation, simulate
    from wbc.sim.state import SimState
    from wbc.sim.step.program import StepProgram, StepSolution, solve_program
    from wbc.sim.step.stages import Impact

__all__ = [
    "Box",
    "ClosedLoop",
    "EnergyAudit",
    "EnergyFlow",
    "HeightField",
    "HuntCrossley",
    "Impact",
    "LoopTick",
    "Plane",
    "Plant",
    "Recorder",
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
    "step.stages": ("Impact",),
    "energy": ("EnergyAudit", "EnergyFlow"),
    "ground": ("Box", "Plane", "Sphere", "Stairs", "Terrain", "Together"),
    "height_field": ("HeightField",),
    "plant": ("HuntCrossley", "Plant"),
    "step.program": ("StepProgram", "StepSolution", "solve_program"),
    "recorder": ("Recorder",),
    "result": ("StepEvent", "StepResult"),
    "sensors": ("Sensor", "SensorModel"),
    "simulation": ("Simulation", "simulate"),
    "state": ("SimState",),
}


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"wbc.sim.{home}"), name)
    raise AttributeError(f"module 'wbc.sim' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__
