"""The plant: convex time steps with gears, ground contact and impacts; recordings are logs."""

from wbc.sim.audit import EnergyAudit
from wbc.sim.closed_loop import (
    ClosedLoop,
    LoopTick,
    SensorNoise,
    TorqueLag,
    with_wrong_efficiencies,
)
from wbc.sim.elements import Elements
from wbc.sim.energy import EnergyFlow
from wbc.sim.impact import Impact
from wbc.sim.plane import Plane
from wbc.sim.plant import Plant
from wbc.sim.program import StepProgram, Unilateral
from wbc.sim.recorder import Recorder
from wbc.sim.residuals import Residuals
from wbc.sim.sensor import Sensor
from wbc.sim.sensor_model import SensorModel
from wbc.sim.simulate import Simulation, simulate
from wbc.sim.solution import StepSolution
from wbc.sim.solver import solve_program
from wbc.sim.stairs import Stairs
from wbc.sim.state import SimState
from wbc.sim.step_result import StepResult
from wbc.sim.terrain import Terrain

__all__ = [
    "ClosedLoop",
    "Elements",
    "EnergyAudit",
    "EnergyFlow",
    "Impact",
    "LoopTick",
    "Plane",
    "Plant",
    "Recorder",
    "Residuals",
    "Sensor",
    "SensorModel",
    "SensorNoise",
    "SimState",
    "Simulation",
    "Stairs",
    "StepProgram",
    "StepResult",
    "StepSolution",
    "Terrain",
    "TorqueLag",
    "Unilateral",
    "simulate",
    "solve_program",
    "with_wrong_efficiencies",
]
