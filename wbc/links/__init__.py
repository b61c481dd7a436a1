"""The one motion of links behind gears that yield, along a log."""

from wbc.links.driven_links import DrivenLinks, LinkFriction, LinkResponse
from wbc.links.shooting import Deflections, deflections

__all__ = ["Deflections", "DrivenLinks", "LinkFriction", "LinkResponse", "deflections"]
