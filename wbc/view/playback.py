"""One offline page that plays a recording."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import meshcat
import numpy as np
import umsgpack
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from meshcat import Visualizer
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wbc.arrays import FloatArray
from wbc.files import write_text
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.robot.coordinates import unit_at
from wbc.sim.ground import Plane, Terrain
from wbc.transmission import Direction
from wbc.view import palette
from wbc.view.channels import Ghost, Track, ghost_at, make_track
from wbc.view.scene import ARROW_HEAD, add_ground, add_paths, add_robot_scene, surface
from wbc.view.shapes import LinkShape, robot_shapes

_LEAST_SPAN = 6.0
_LOADED = 0.02  # weights above which a contact bears something
_LEAVES = 1.2  # sizes of the robot: one that moves on further is followed, not framed as a whole
_FRAMED = 200  # frames whose bodies the camera frames: twelve missed the furthest swing of an arm
_COLOURS = {
    "modes": {str(int(d)): palette.DIRECTION_COLOURS[d] for d in Direction},
    "quiet": "#C9CED6",
    "slip": palette.VERMILION,
    "over": palette.RESIDUAL_OVER,
    "under": palette.RESIDUAL_UNDER,
    "cone": palette.YELLOW,
    "force": palette.GREEN,
    # While residuals are shown, the model has the colour that plots give the model as given.
    "ghost": palette.VERMILION,
    "other_ghost": palette.GHOST,
}


def _body(robot: Robot, poses: FloatArray) -> dict[str, Any]:
    return {"joints": robot.model.njoints, "poses": _packed(poses)}


def _packed(values: ArrayLike) -> str:
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def _contact(robot: Robot, track: Track, name: str, ground: Terrain | None) -> dict[str, Any]:
    return {
        "name": name,
        "friction": robot.contact(name).friction,
        "position": _packed(track.points[name]),
        "force": _packed(track.forces[name]),
        "normal": _packed(surface(ground, track.points[name])[1]),
        "largest": float(np.linalg.norm(track.forces[name], axis=1).max()),
    }


def _gear(robot: Robot, track: Track, k: int, residual: Mapping[str, FloatArray]) -> dict[str, Any]:
    gears, torque = robot.transmission, track.torque[:, k]
    joint, limit = gears.joints[k], float(np.abs(gears.gear_ratio[k]) * gears.torque_limit[k])
    return {
        "name": joint,
        "number": robot.model.getJointId(joint),
        "unit": unit_at(robot, joint, "N m"),
        "torque": _packed(torque),
        "power": _packed(track.power[:, k]),
        "direction": _packed(np.nan_to_num(track.direction[:, k])),
        "largest": float(np.nanmax(np.abs(torque))) if np.isfinite(torque).any() else 0.0,
        "limit": limit if np.isfinite(limit) else None,
        "residual": _packed(residual[joint]) if joint in residual else None,
    }


def _arrow_scale(track: Track, weight: float, reach: float) -> float:
    """Return the length of a force arrow [m/N], 0.45 reach for a large force that is no impact.

    Many arrows are shorter, so that all of them cover about as much of the robot as one does.
    """
    forces = [np.linalg.norm(force, axis=1) for force in track.forces.values()]
    largest = np.max(forces, axis=0, initial=0.0)
    loaded = largest[largest > _LOADED * weight]
    # A robot without weight that touches nothing shows no arrow, whatever its scale.
    usual = float(np.quantile(loaded, 0.9)) if loaded.size else weight or 1.0
    return float(0.45 * reach / usual / max(len(forces), 1) ** 0.5)


def _marks(track: Track, marks: Mapping[str, float]) -> list[dict[str, Any]]:
    found = [(i.time, f"impact of {i.contact}, {i.force:.0f} N") for i in track.impacts]
    found += [(float(time), name) for name, time in marks.items()]
    inside = sorted(one for one in found if track.time[0] <= one[0] <= track.time[-1])
    return [{"time": time, "label": f"{name} at {time:.3f} s"} for time, name in inside]


def _camera(
    track: Track, shapes: Sequence[LinkShape], ghost: FloatArray | None, leaves: bool
) -> dict[str, Any]:
    """Return the points that the camera frames and its direction.

    The points are the corners of all bodies along the motion, and of the ghost's. The camera
    follows a robot that leaves the picture over the ground: its points are moved back to where it
    starts. A robot that lives in the x-z plane is seen nearly along y.
    """
    flat = bool(np.ptp(track.poses[:, 1:, 1]) < 1e-6)
    count = len(track.time)
    frames = np.linspace(0, count - 1, min(count, _FRAMED)).astype(int)
    seen = [_corners(track.poses[frames], shapes)]
    seen += [track.points[name][frames][:, None] for name in track.forces]
    if ghost is not None and not leaves:
        seen.append(_corners(ghost[frames], shapes))
    if not shapes and not track.forces:
        seen = [track.poses[frames, :, :3]]  # links without bodies
    points = np.concatenate(seen, axis=1)
    if leaves:
        moved = track.center_of_mass[frames] - track.center_of_mass[0]
        points = points - moved[:, None] * [1.0, 1.0, 0.0]
    # Those that are outermost along some of 200 directions.
    points, ways = points.reshape(-1, 3), np.random.default_rng(0).standard_normal((200, 3))
    outer = points[np.unique(np.argmax(points @ ways.T, axis=0))]
    direction = np.array([0.28, -0.94, 0.2] if flat else [0.75, -0.6, 0.32])
    return {
        "points": np.round(outer, 4).tolist(),
        "direction": (direction / np.linalg.norm(direction)).tolist(),
    }


def _corners(poses: FloatArray, shapes: Sequence[LinkShape]) -> FloatArray:
    """Return the corners (F, 8 bodies, 3) of the boxes of all bodies, world.

    Args:
        poses: (F, joints, 7) translation and quaternion (x, y, z, w) of every joint.
        shapes: the bodies.
    """
    corners = [np.zeros((len(poses), 0, 3))]
    for shape in shapes:
        place = poses[:, shape.joint]
        turn = Rotation.from_quat(place[:, 3:]).as_matrix()
        corners.append(shape.corners @ np.swapaxes(turn, 1, 2) + place[:, None, :3])
    return np.concatenate(corners, axis=1)


_VIEWER = Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js"


def write_playback(
    path: str | Path,
    robot: Robot,
    log: Log,
    *,
    ghost: Ghost | None = None,
    ground: Terrain | None = None,
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
            Of set points with accelerations (`wbc experiment`) the torques that the model needs,
            their limits, and the paths of the contact points are shown.
        ghost: a second, transparent robot beside it (`model_ghost`); the joints take the colour of
            its residuals.
        ground: what it stands on; level ground under the loaded contacts when left out.
        marks: label -> time [s] to mark on the timeline beside the impacts found.
        title: headline, the robot's name when left out.
        theme: "light", "dark", or "" for what the reader's system prefers.
        at: [s] where the page waits; it plays at once when left out.

    Raises:
        LogError: the log holds no position of the robot.
        ViewError: ground of a kind that has no picture.
    """
    track = make_track(robot, log)
    recorder = _Recorder()
    root = Visualizer(window=recorder)["/wbc"]
    ground, center = ground or _level_ground(track, robot.weight), track.center_of_mass
    # A robot that hangs below its contact would be hidden by its ground.
    mean = center.mean(axis=0)[None]
    opacity = 1.0 if ground is None or mean[0, 2] >= surface(ground, mean)[0][0] else 0.3
    shapes = robot_shapes(robot)
    reach = add_robot_scene(root, robot, shapes, list(track.forces))
    add_ground(root["ground"], ground, center, opacity)
    # Only a robot with a free base moves away.
    floating = robot.floating_size > 0
    leaves = floating and bool(np.ptp(center[:, :2], axis=0).max() > _LEAVES * reach)
    add_paths(root["paths"], track.points if track.planned else {})
    poses, residual, beside = None, dict[str, FloatArray](), None
    if ghost is not None:
        poses, residual = ghost_at(robot, ghost, track.time)
        beside = {"label": ghost.label, **_body(robot, poses)}
    shown = _marks(track, marks or {})
    scene = {  # arrays are base64 of float32
        "modes": {str(int(d)): palette.DIRECTION_LABELS[d] for d in Direction},
        "time": _packed(track.time),
        "robot": _body(robot, track.poses),
        "ghost": beside,
        "com": _packed(track.center_of_mass),
        "floor": None if ground is None else surface(ground, center)[0].round(5).tolist(),
        "contacts": [_contact(robot, track, name, ground) for name in track.forces],
        "gears": [_gear(robot, track, k, residual) for k in range(robot.transmission.size)],
        "marks": shown,
        "mark_name": "mark" if len(shown) > len(track.impacts) else "impact",
        "weight": robot.weight,
        "reach": reach,
        "arrow_head": ARROW_HEAD * reach,
        "metres_per_newton": _arrow_scale(track, robot.weight, reach),
        "camera": _camera(track, shapes, poses, leaves),
        "floating": floating,
        "planned": track.planned,
        "follow": leaves,
        # Noise floors of the full colour: few residuals exceed it.
        "residual_span": max(_LEAST_SPAN, np.quantile(np.abs([*residual.values()] or 0), 0.95)),
        "autoplay": at is None,
        "at": float(track.time[0]) if at is None else at,
        "colours": _COLOURS,
        "commands": recorder.commands,
    }
    template = pages("player").get_template("playback.html.j2")
    viewer, title = _VIEWER.read_text(encoding="utf-8"), title or robot.name
    page = template.render(title=title, theme=theme, meshcat=viewer, scene=embedded(scene))
    return write_text(path, page)


def pages(folder: str, **more: Any) -> Environment:
    """Return what fills the templates of a folder beside this file."""
    home = FileSystemLoader(Path(__file__).parent / folder)
    return Environment(loader=home, undefined=StrictUndefined, **more)


def embedded(value: object) -> str:
    """Return JSON that can stand inside a script element."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def _level_ground(track: Track, weight: float) -> Plane | None:
    """Return the plane on which the loaded contacts stand, None where no contact is loaded."""
    heights = [
        track.points[name][np.linalg.norm(force, axis=1) > 0.05 * weight, 2]
        for name, force in track.forces.items()
    ]
    loaded = np.concatenate([np.zeros(0), *heights])
    return Plane(height=float(np.median(loaded))) if loaded.size else None


class _Recorder:
    """Stands where meshcat's `ViewerWindow` stands; nothing is opened, nothing is served.

    Attributes:
        commands: as the base64 text of their messages.
    """

    def __init__(self) -> None:
        self.commands: list[str] = []

    def send(self, command: Any) -> None:
        """Keep one meshcat command."""
        self.commands.append(base64.b64encode(umsgpack.packb(command.lower())).decode("ascii"))
