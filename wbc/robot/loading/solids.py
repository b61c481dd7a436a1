"""The geometry of a robot's model file, on the robot's own joints."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import pinocchio as pin

from wbc.errors import RobotError, unknown_name
from wbc.robot.loading.description import read_description
from wbc.robot.loading.library import find_model
from wbc.robot.robot import Robot


class PlacedGeometry(NamedTuple):
    """One visual or collision solid of a model file.

    Attributes:
        item: as the model file gives it.
        frame: number of the robot's frame that carries it.
        joint: number of the robot's joint that moves it, 0 for the world.
        placement: in the frame of that joint.
    """

    item: Any
    frame: int
    joint: int
    placement: pin.SE3


def placed_geometry(robot: Robot, kind: pin.GeometryType) -> list[PlacedGeometry]:
    """Return the visuals or collision solids of the robot's model file; none without any.

    The links are found by their frame's name, so that a robot with a free-flyer or with welded
    joints finds them too.
    """
    path = _model_path(robot)
    if path is None:
        return []
    try:
        whole, geometry = _model_geometry(path, kind)
    except (ValueError, RuntimeError):
        # The links moved this far, so the file is sound: only its meshes are not installed.
        return []
    placed = []
    for item in geometry.geometryObjects:
        frame = whole.frames[item.parentFrame]
        if not robot.model.existFrame(frame.name):
            continue
        number = robot.model.getFrameId(frame.name)
        here = robot.model.frames[number]
        placement = here.placement * frame.placement.inverse() * item.placement
        placed.append(PlacedGeometry(item, number, here.parentJoint, placement))
    return placed


def collision_solids(robot: Robot) -> pin.GeometryModel:
    """Return the collision solids of the robot's model file and its surface; empty without any.

    Meshes become their convex hulls.
    """
    found = pin.GeometryModel()
    for item, frame, joint, placement in placed_geometry(robot, pin.GeometryType.COLLISION):
        shape = item.geometry
        if hasattr(shape, "buildConvexRepresentation"):
            shape.buildConvexRepresentation(False)
            shape = shape.convex or shape
        found.addGeometryObject(pin.GeometryObject(item.name, joint, frame, placement, shape))
    for solid in robot.surface.solids:
        if not robot.model.existFrame(solid.link):
            known = [own.name for own in robot.model.frames]
            raise RobotError(unknown_name(f"frame of '{robot.name}'", solid.link, known))
        frame = robot.model.getFrameId(solid.link)
        joint, placement = (
            robot.model.frames[frame].parentJoint,
            robot.model.frames[frame].placement,
        )
        found.addGeometryObject(
            pin.GeometryObject(solid.link, joint, frame, placement, solid.shape)
        )
    return found


def _model_path(robot: Robot) -> Path | None:
    """Return the URDF or MJCF file that a robot was loaded from, None where there is none."""
    if robot.source is None:
        return None
    try:
        description = read_description(robot.source.name)
        while description.base_robot is not None:
            description = description.base()
        return find_model(str(description.table["model"]), description.path.parent)
    except RobotError:
        return None


def _model_geometry(path: Path, kind: pin.GeometryType) -> tuple[pin.Model, pin.GeometryModel]:
    """Return the links of a model file, and its visuals or collision solids."""
    if path.suffix == ".xml":
        model = pin.buildModelFromMJCF(str(path))
        return model, pin.buildGeomFromMJCF(model, str(path), kind)
    model = pin.buildModelFromUrdf(str(path))
    # `package://` addresses count from the folder above the package.
    folders = [str(folder) for folder in path.resolve().parents]
    return model, pin.buildGeomFromUrdf(model, str(path), kind, package_dirs=folders)
