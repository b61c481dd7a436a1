"""The collision solids of a robot's model file, on the robot's own joints."""

from __future__ import annotations

from pathlib import Path

import pinocchio as pin

from wbc.errors import RobotError
from wbc.robot.loading.description import read_description
from wbc.robot.loading.library import find_model
from wbc.robot.robot import Robot


def model_path(robot: Robot) -> Path | None:
    """Return the URDF or MJCF file that a robot was loaded from, None where there is none."""
    if robot.source is None:
        return None
    try:
        description = read_description(robot.source.name)
        if description.base_robot is not None:
            return None
        return find_model(str(description.table["model"]), description.path.parent)
    except RobotError:
        return None


def model_geometry(path: Path, kind: pin.GeometryType) -> tuple[pin.Model, pin.GeometryModel]:
    """Return the links of a model file, and its visuals or collision solids."""
    if path.suffix == ".xml":
        model = pin.buildModelFromMJCF(str(path))
        return model, pin.buildGeomFromMJCF(model, str(path), kind)
    model = pin.buildModelFromUrdf(str(path))
    # `package://` addresses count from the folder above the package.
    folders = [str(folder) for folder in path.resolve().parents]
    return model, pin.buildGeomFromUrdf(model, str(path), kind, package_dirs=folders)


def collision_solids(robot: Robot) -> pin.GeometryModel:
    """Return the collision solids of the robot's model file, without pairs; empty without any.

    Meshes become their convex hulls. The links are found by their frame's name, so that a robot
    with a free-flyer or with welded joints finds them too.
    """
    found, path = pin.GeometryModel(), model_path(robot)
    if path is None:
        return found
    try:
        whole, solids = model_geometry(path, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError):
        # The links moved this far, so the file is sound: only its meshes are not installed.
        return found
    for solid in solids.geometryObjects:
        frame = whole.frames[solid.parentFrame]
        if not robot.model.existFrame(frame.name):
            continue
        number = robot.model.getFrameId(frame.name)
        here = robot.model.frames[number]
        shape = solid.geometry
        if hasattr(shape, "buildConvexRepresentation"):
            shape.buildConvexRepresentation(False)
            shape = shape.convex or shape
        placement = here.placement * frame.placement.inverse() * solid.placement
        found.addGeometryObject(
            pin.GeometryObject(solid.name, here.parentJoint, number, placement, shape)
        )
    return found
