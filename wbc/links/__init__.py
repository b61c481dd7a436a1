"""The one motion of links behind gears that yield, along a log."""

from wbc.links.deflection import Deflections, deflections
from wbc.links.driven_links import COARSE, DrivenLinks
from wbc.links.response import LinkFriction, LinkResponse
from wbc.links.swing_start import likely_start, own_frequency, typical_start

__all__ = [
    "COARSE",
    "Deflections",
    "DrivenLinks",
    "LinkFriction",
    "LinkResponse",
    "deflections",
    "likely_start",
    "own_frequency",
    "typical_start",
]
