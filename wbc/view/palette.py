"""Colours that print and that the colour-blind can tell apart, for a light and a dark page."""

from __future__ import annotations

from dataclasses import dataclass

from wbc.transmission import Direction

BLUE = "#0072B2"
SKY = "#56B4E9"
GREEN = "#009E73"
YELLOW = "#F0E442"
ORANGE = "#E69F00"
VERMILION = "#D55E00"
PURPLE = "#CC79A7"
GREY = "#8A8F98"
GHOST = "#7E57C2"

RESIDUAL_OVER = "#762A83"
RESIDUAL_UNDER = "#1B7837"
"""Ends of the scale of a residual's colour (ColorBrewer's PRGn): not those of power or model."""

SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
"""Line colours in order (Okabe and Ito, Color Universal Design, 2008)."""

DIRECTION_COLOURS = {Direction.FORWARD: BLUE, Direction.BACKWARD: VERMILION, Direction.STUCK: GREY}
DIRECTION_LABELS = {
    Direction.FORWARD: "motor drives",
    Direction.BACKWARD: "joint drives",
    Direction.STUCK: "stuck or idle",
}
"""Direction of the mesh power in words, the same in plots and in playbacks."""


@dataclass(frozen=True)
class Theme:
    """Colours of a page.

    Attributes:
        name: "light" or "dark".
        page: background.
        ink: text and axes.
        faint: grid and secondary text.
        panel: background of a plot area or card.
        series: line colours in order.
    """

    name: str
    page: str
    ink: str
    faint: str
    panel: str
    series: tuple[str, ...] = SERIES


LIGHT = Theme("light", "#FFFFFF", "#1B1F24", "#C9CED6", "#FFFFFF")
DARK = Theme(
    "dark",
    "#14171C",
    "#E6E9EE",
    "#3C434E",
    "#1B1F26",
    ("#4FA3DC", "#F2894A", "#3CC79A", "#E39BC2", "#F3B94A", "#8FD0F5"),
)
