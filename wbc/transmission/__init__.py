"""Reduction, topology, efficiencies and the mesh law."""

from wbc.transmission.mesh import (
    CompoundPlanetaryGear as CompoundPlanetaryGear,
    Direction as Direction,
    Flanks as Flanks,
    WedgeBlock as WedgeBlock,
    direction as direction,
    efficiency as efficiency,
    mesh_input as mesh_input,
    stribeck as stribeck,
    wedge_backward_efficiency as wedge_backward_efficiency,
)
from wbc.transmission.transmission import (
    DRIVE_TIMES as DRIVE_TIMES,
    GEAR_NUMBERS as GEAR_NUMBERS,
    Transmission as Transmission,
)
