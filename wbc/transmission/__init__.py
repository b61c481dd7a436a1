"""Reduction, topology, efficiencies and the mesh law."""

from wbc.transmission.machines import CompoundPlanetaryGear, WedgeBlock
from wbc.transmission.mesh import (
    Direction,
    Flanks,
    direction,
    efficiency,
    mesh_input,
    wedge_backward_efficiency,
)
from wbc.transmission.transmission import DRIVE_TIMES, GEAR_NUMBERS, Transmission

__all__ = [
    "DRIVE_TIMES",
    "GEAR_NUMBERS",
    "CompoundPlanetaryGear",
    "Direction",
    "Flanks",
    "Transmission",
    "WedgeBlock",
    "direction",
    "efficiency",
    "mesh_input",
    "wedge_backward_efficiency",
]
