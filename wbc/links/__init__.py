"""The one motion of links behind gears that yield, along a log."""

from wbc.links.driven_links import LinkFriction as LinkFriction, LinkResponse as LinkResponse
from wbc.links.shooting import Deflections as Deflections, deflections as deflections
