"""One offline page that plays a recording."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import meshcat
import numpy as np
import umsgpack
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from meshcat import Visualizer

from wbc.files import write_text
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.sim.ground.terrain import Terrain
from wbc.view.ghost import Ghost
from wbc.view.ground import GroundSlab, flat_ground, surface_under, terrain_slabs
from wbc.view.payload import playback_payload
from wbc.view.scene import add_robot_scene
from wbc.view.shapes import robot_shapes
from wbc.view.track import Track, make_track, track_ghost

_PLAYER = Path(__file__).parent / "player"
# One script for the page, in this order: each file uses what stands in those before it.
_SCRIPTS = tuple(
    f"{name}.js"
    for name in ("data", "scene", "motion", "camera", "readout", "timeline", "control", "start")
)


def write_playback(
    path: str | Path,
    robot: Robot,
    log: Log,
    *,
    ghost: Ghost | None = None,
    ground: Terrain | Sequence[GroundSlab] | None = None,
    marks: Mapping[str, float] | None = None,
    title: str | None = None,
    theme: str = "",
    at: float | None = None,
) -> Path:
    """Write one HTML file that shows a log or recording in motion, without any network.

    The page has a timeline with the direction of power in every gear, contact forces and marks,
    play and pause, speed, frame stepping, a camera that frames the robot, and switches for force
    arrows, friction cones and centre of mass.

    Args:
        path: the file to write (whole or not at all).
        robot: the robot of the log.
        log: positions at least; velocities, torques and contact forces are shown if it has them.
        ghost: a second, transparent robot beside it (`model_ghost`, `log_ghost`); with its
            residuals the joints take their colour.
        ground: what it stands on; level ground under the loaded contacts when left out.
        marks: label -> time [s] to mark on the timeline beside the impacts found.
        title: headline, the robot's name when left out.
        theme: "light", "dark", or "" for what the reader's system prefers.
        at: [s] where the page waits; it plays at once when left out.

    Raises:
        LogError: the log holds no position of the robot.
    """
    page = playback_page(
        robot, log, ghost=ghost, ground=ground, marks=marks, title=title, theme=theme, at=at
    )
    return write_text(path, page)


def playback_page(
    robot: Robot,
    log: Log,
    *,
    ghost: Ghost | None = None,
    ground: Terrain | Sequence[GroundSlab] | None = None,
    marks: Mapping[str, float] | None = None,
    title: str | None = None,
    theme: str = "",
    at: float | None = None,
) -> str:
    """Return the HTML text of `write_playback`, with the same arguments."""
    track = make_track(robot, log)
    recorder = CommandRecorder()
    root = recorder.visualizer()["/wbc"]
    slabs = _slabs(track, ground)
    contacts = [contact.name for contact in track.contacts]
    shapes = robot_shapes(robot)
    size = add_robot_scene(root, robot, shapes, slabs, contacts, _ground_opacity(track, slabs))
    shadow = None if ghost is None else track_ghost(robot, ghost, track.time)
    scene = playback_payload(
        robot, track, size, shapes, slabs, recorder.encoded(), marks or {}, shadow, at
    )
    environment = Environment(loader=FileSystemLoader(_PLAYER), undefined=StrictUndefined)
    return environment.get_template("playback.html.j2").render(
        title=title or robot.name,
        theme=theme,
        css=(_PLAYER / "player.css").read_text(encoding="utf-8"),
        script="\n".join((_PLAYER / name).read_text(encoding="utf-8") for name in _SCRIPTS),
        meshcat=meshcat_script(),
        scene=scene.replace("<", "\\u003c"),
    )


@cache
def meshcat_script() -> str:
    """Return meshcat's viewer, the JavaScript that its wheel carries."""
    folder = Path(meshcat.__file__).parent / "viewer" / "dist"
    return (folder / "main.min.js").read_text(encoding="utf-8")


def _slabs(track: Track, ground: Terrain | Sequence[GroundSlab] | None) -> tuple[GroundSlab, ...]:
    if ground is not None and not isinstance(ground, Terrain):
        return tuple(ground)
    size = float(np.ptp(track.center_of_mass, axis=0).max() + 2.5)
    center = 0.5 * (track.center_of_mass.min(axis=0) + track.center_of_mass.max(axis=0))
    if ground is not None:
        return terrain_slabs(ground, center, size)
    heights = [
        contact.position[np.linalg.norm(contact.force, axis=1) > 0.05 * track.weight, 2]
        for contact in track.contacts
    ]
    loaded = np.concatenate(heights) if heights else np.zeros(0)
    return flat_ground(float(np.median(loaded)), center, size) if loaded.size else ()


def _ground_opacity(track: Track, slabs: Sequence[GroundSlab]) -> float:
    """Return 1, or little for a robot that hangs below its contact and would be hidden."""
    if not slabs:
        return 1.0
    center = track.center_of_mass.mean(axis=0)
    return 1.0 if center[2] >= surface_under(slabs, center)[0] else 0.3


class CommandRecorder:
    """Stands where meshcat's `ViewerWindow` stands; nothing is opened, nothing is served."""

    def __init__(self) -> None:
        """Start with an empty scene."""
        self._commands: list[bytes] = []

    def send(self, command: Any) -> None:
        """Keep one meshcat command."""
        self._commands.append(umsgpack.packb(command.lower()))

    def visualizer(self) -> Visualizer:
        """Return a meshcat visualizer that draws into this recorder."""
        return Visualizer(window=self)

    def encoded(self) -> list[str]:
        """Return the commands, each as the base64 text of its message."""
        return [base64.b64encode(command).decode("ascii") for command in self._commands]
