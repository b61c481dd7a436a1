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
    from wbc.sim.ground import Box, HeightField, Plane, Sphere, Stairs, Terrain, Together
    from wbc.sim.plant import HuntCrossley, Plant
    from wbc.sim.result import Impact, StepEvent, StepResult
    from wbc.sim.sensors import Sensor, SensorModel
    from wbc.sim.simulation import Recorder, Simulation, simulate
    from wbc.sim.step.tables import SimState

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
    "StepResult",
    "Terrain",
    "Together",
    "TorqueLag",
    "simulate",
    "with_wrong_efficiencies",
]

# From light to heavy: a name comes from the first that has it.
_HOMES = "ground", "sensors", "energy", "step.tables", "plant", "simulation", "closed_loop"


def __getattr__(name: str) -> Any:
    for home in _HOMES if name in __all__ else ():
        module = import_module(f"wbc.sim.{home}")
        if name in vars(module):
            return vars(module)[name]
    raise AttributeError(f"module 'wbc.sim' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__
