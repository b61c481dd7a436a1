"""What each link of a robot looks like: the visuals of its model file, or capsules."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.robot import Robot, placed_geometry
from wbc.view.palette import rgb
from wbc.view.scene.geometry import along, capsule, meshcat_geometry

_NEUTRALS = ("#5F6B7A", "#8C98A8", "#B4BECB")


@dataclass(frozen=True, eq=False)
class LinkShape:
    """One drawn body.

    Attributes:
        name: unique on the robot.
        joint: number of the joint that moves it, 0 for the world.
        placement: of the body in the frame of that joint.
        geometry: what meshcat draws.
        colour: red, green, blue in [0, 1].
        low, high: (3,) [m] corners of its box in the frame of the joint.
    """

    name: str
    joint: int
    placement: pin.SE3
    geometry: Any
    colour: tuple[float, float, float]
    low: FloatArray
    high: FloatArray


def robot_shapes(robot: Robot) -> tuple[LinkShape, ...]:
    """Return the visuals of the robot's model file, or capsules between its joints without any."""
    shapes = []
    for item, _, joint, placement in placed_geometry(robot, pin.GeometryType.VISUAL):
        geometry = meshcat_geometry(item.geometry)
        if geometry is not None:
            colour, box = _colour(item, joint), _box(item.geometry, placement)
            shapes.append(LinkShape(item.name, joint, placement, geometry, colour, *box))
    return tuple(shapes) if any(shape.joint > 0 for shape in shapes) else stick_shapes(robot)


def _colour(item: pin.GeometryObject, joint: int) -> tuple[float, float, float]:
    given = np.asarray(item.meshColor)[:3]
    # pinocchio's own default for "no material" tells nothing; a neutral per link does.
    if np.allclose(given, 0.9):
        return rgb(_NEUTRALS[joint % len(_NEUTRALS)])
    return float(given[0]), float(given[1]), float(given[2])


def _box(shape: Any, placement: pin.SE3) -> tuple[FloatArray, FloatArray]:
    shape.computeLocalAABB()
    box: coal.AABB = shape.aabb_local
    ends = np.array([np.asarray(box.min_), np.asarray(box.max_)])
    corners = np.array(
        [[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    moved = corners @ placement.rotation.T + placement.translation
    return moved.min(axis=0), moved.max(axis=0)


def stick_shapes(robot: Robot) -> tuple[LinkShape, ...]:
    """Return capsules from each joint to the joints and contacts that it carries.

    A link on which nothing is far away is drawn as the uniform box of its mass and inertia.
    """
    model = robot.model
    ends: dict[int, list[FloatArray]] = {joint: [] for joint in range(model.njoints)}
    for joint in range(1, model.njoints):
        ends[int(model.parents[joint])].append(np.asarray(model.jointPlacements[joint].translation))
    for contact in robot.contacts:
        frame = model.frames[model.getFrameId(contact.frame)]
        ends[int(frame.parentJoint)].append(np.asarray(frame.placement.act(contact.offset)))
    lengths = [float(np.linalg.norm(end)) for joint in ends for end in ends[joint]]
    radius = 0.05 * max([length for length in lengths if length > 1e-9], default=0.5)
    shapes: list[LinkShape] = []
    for joint in range(1, model.njoints):
        far = [end for end in ends[joint] if np.linalg.norm(end) > 1e-9]
        # Balls of one size in one place flicker: links that meet differ in thickness.
        own = radius * (1.0 - 0.05 * (joint % len(_NEUTRALS)))
        shapes += [_rod(robot, joint, i, end, own) for i, end in enumerate(far)]
        if not far and model.inertias[joint].mass > 0.0:
            shapes.append(_inertia_box(robot, joint, radius))
    return tuple(shapes)


def _rod(robot: Robot, joint: int, number: int, end: FloatArray, radius: float) -> LinkShape:
    return LinkShape(
        f"{robot.model.names[joint]}_{number}",
        joint,
        pin.SE3(along(end), 0.5 * end),
        capsule(float(np.linalg.norm(end)), radius),
        rgb(_NEUTRALS[joint % len(_NEUTRALS)]),
        np.minimum(end, 0.0) - radius,
        np.maximum(end, 0.0) + radius,
    )


def _inertia_box(robot: Robot, joint: int, least: float) -> LinkShape:
    inertia = robot.model.inertias[joint]
    moments, axes = np.linalg.eigh(np.asarray(inertia.inertia))
    squares = 6.0 / inertia.mass * (moments.sum() - 2.0 * moments)
    sides = np.maximum(np.sqrt(np.maximum(squares, 0.0)), least)
    if np.linalg.det(axes) < 0.0:
        axes = axes * np.array([1.0, 1.0, -1.0])
    shape = coal.Box(*[float(side) for side in sides])
    placement = pin.SE3(axes, np.asarray(inertia.lever))
    return LinkShape(
        f"{robot.model.names[joint]}_box",
        joint,
        placement,
        meshcat_geometry(shape),
        rgb(_NEUTRALS[joint % len(_NEUTRALS)]),
        *_box(shape, placement),
    )
