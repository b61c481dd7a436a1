"""The paper's wedge and block with their forces, moving: driven by the wedge, and by the block.

The block moves along x, the wedge up a smooth slope of angle alpha. They touch at an upright face,
on which the wedge slips. The friction mu lambda on this face turns with the motion, the force
lambda does not. So the wedge needs more force to drive the block than it holds while the block
drives it. Both move evenly, so that all forces balance.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from PIL import Image

from wbc.arrays import FloatArray
from wbc.files import atomic_write
from wbc.transmission import Direction, WedgeBlock
from wbc.view import LIGHT, Theme
from wbc.view.palette import DIRECTION_COLOURS
from wbc.view.plots import drawing, new_figure, write_figure

OUT = Path("out")
ALPHA, MU, LOAD = np.deg2rad(40.0), 0.4, 1.0  # assumed, for a picture that is easy to read; [N]
_TRAVEL = 0.7  # of the wedge along its slope, in the units of the drawing


def forces(direction: Direction) -> dict[str, float]:
    """Return the forces of the evenly moving wedge [N], and its efficiency in this direction."""
    wedge = WedgeBlock(2.0, 0.5, float(ALPHA), MU)
    forward = direction is Direction.FORWARD
    speed = 1.0 if forward else -1.0
    # With the paper's signs a force that presses is negative.
    _, mesh = wedge.mesh_force(-LOAD, speed)
    return {
        "f_x": LOAD,
        "lambda": LOAD,
        "friction": speed * MU * LOAD,
        "f_u": -float(mesh),
        "efficiency": wedge.forward_efficiency if forward else wedge.backward_efficiency,
    }


def forces_figure(share: float = 0.5, theme: Theme = LIGHT) -> Figure:
    """Return the wedge driven and back-driven, after a share (0 to 1) of its motion."""
    with drawing(theme):
        figure, grid = new_figure(1, 2, 9.6, 3.9)
        for ax, direction in zip(grid[0], (Direction.FORWARD, Direction.BACKWARD), strict=True):
            _scene(ax, direction, share, theme)
    return figure


def film(path: str | Path, frames: int = 24) -> Path:
    """Write the motion as an animated GIF."""
    pictures = []
    for frame in range(frames):
        figure = forces_figure(0.5 - 0.5 * float(np.cos(np.pi * frame / (frames - 1))))
        figure.set_dpi(80)
        figure.canvas.draw()
        canvas: Any = figure.canvas
        pixels = np.asarray(canvas.buffer_rgba())
        pictures.append(Image.fromarray(pixels).convert("RGB").quantize(64))
    first, *rest = pictures
    return atomic_write(
        path,
        lambda file: first.save(
            file, format="GIF", save_all=True, append_images=rest, duration=60, loop=0
        ),
    )


def _scene(ax: Axes, direction: Direction, share: float, theme: Theme) -> None:
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.set(xlim=(-2.5, 3.0), ylim=(-1.35, 2.2))
    colour, found = DIRECTION_COLOURS[direction], forces(direction)
    forward = direction is Direction.FORWARD
    along = np.array([np.cos(ALPHA), np.sin(ALPHA)])
    moved = _TRAVEL * ((share if forward else 1.0 - share) - 0.5)
    slope = np.array([-2.0 * along, 1.05 * along])
    ax.plot(*slope.T, color=theme.ink, linewidth=1.0)
    ax.plot([0.1, 2.9], [0.82, 0.82], color=theme.ink, linewidth=1.0)
    foot = moved * along
    # The wedge: its lower side lies on the slope, its right side is the upright face.
    face = foot + np.array([[0.0, 0.0], [0.0, 1.6]])
    body = np.array(
        [face[0], face[1], foot + np.array([-0.9, 0.95]), foot - 0.9 / np.cos(ALPHA) * along]
    )
    ax.add_patch(Polygon(body, facecolor=colour, alpha=0.25, edgecolor=colour))
    left = float(face[0, 0])
    ax.add_patch(Rectangle((left, 0.82), 1.1, 0.75, facecolor=theme.faint, edgecolor=theme.ink))
    touch = np.array([left, 1.2])
    hand = foot - 0.6 * along + np.array([-0.1, 0.25])
    shown = (
        (hand - found["f_u"] * along, hand, f"f_u = {found['f_u']:.2f} N", "below"),
        (touch, touch - [found["lambda"], 0.0], "λ = 1 N", "center"),
        (
            touch,
            touch - [0.0, found["friction"]],
            f"μλ = {abs(found['friction']):.2f} N",
            "left",
        ),
        ([left + 2.1, 1.2], [left + 1.1, 1.2], "f_x = 1 N", "center"),
    )
    for start, end, label, side in shown:
        _arrow(ax, np.asarray(start), np.asarray(end), label, side, theme)
    way = along if forward else -along
    _motion(ax, foot + np.array([-0.55, 1.75]), 0.5 * way, theme)
    _motion(ax, np.array([left + 0.55, 1.8]), np.array([0.4 if forward else -0.4, 0.0]), theme)
    wedge, block = found["f_u"] / np.cos(ALPHA), found["f_x"]  # powers at 1 m/s of the block
    put_in, out = (wedge, block) if forward else (block, wedge)
    driver, symbol = ("wedge", "eta_f") if forward else ("block", "eta_b")
    words = f"the {driver} drives: {put_in:.2f} W in, {out:.2f} W out, {symbol} = "
    ax.set_title(words + f"{found['efficiency']:.2f}", color=colour)


def _arrow(
    ax: Axes, start: FloatArray, end: FloatArray, label: str, side: str, theme: Theme
) -> None:
    style = {"arrowstyle": "-|>", "color": theme.ink, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (end[0], end[1]), (start[0], start[1]), arrowprops=style)
    x, y = 0.5 * (start + end)
    away = {"left": (0.08, -0.02), "below": (0.22, -0.36), "center": (0.0, 0.06)}[side]
    across, upright = ("center", "bottom") if side == "center" else ("left", "center")
    ax.text(x + away[0], y + away[1], label, fontsize=8, ha=across, va=upright)


def _motion(ax: Axes, place: FloatArray, way: FloatArray, theme: Theme) -> None:
    style = {"arrowstyle": "->", "color": theme.series[2], "lw": 1.6}
    (x, y), (dx, dy) = place, 0.5 * way
    ax.annotate("", (x + dx, y + dy), (x - dx, y - dy), arrowprops=style)


def main() -> dict[str, dict[str, float]]:
    """Return the forces in both directions."""
    return {way.name.lower(): forces(way) for way in (Direction.FORWARD, Direction.BACKWARD)}


def report(found: dict[str, dict[str, float]], frames: int = 24) -> list[Path]:
    """Print the forces; return the picture and the film."""
    for way, rows in found.items():
        print(way, ", ".join(f"{name} {value:.3f}" for name, value in rows.items()))
    return [
        write_figure(OUT / "wedge_forces.png", forces_figure()),
        film(OUT / "wedge_forces.gif", frames),
    ]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
