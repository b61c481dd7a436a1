"""Reduction, topology, efficiencies and the mesh law."""

from wbc.transmission.machines import (
    CompoundPlanetaryGear as CompoundPlanetaryGear,
    WedgeBlock as WedgeBlock,
)
from wbc.transmission.mesh import (
    Direction as Direction,
    Flanks as Flanks,
    direction as direction,
    efficiency as efficiency,
    mesh_input as mesh_input,
    wedge_backward_efficiency as wedge_backward_efficiency,
)
from wbc.transmission.transmission import (
    DRIVE_TIMES as DRIVE_TIMES,
    GEAR_NUMBERS as GEAR_NUMBERS,
    Transmission as Transmission,
)
