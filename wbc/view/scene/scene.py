"""The bodies of a scene, built once; a playback or a live view moves them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import meshcat.geometry as mg
import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.robot import Robot
from wbc.robot.coordinates import joint_axis
from wbc.view.palette import GREEN, GREY, PURPLE, YELLOW, rgb
from wbc.view.quantities.impacts import robot_weight
from wbc.view.scene.geometry import UprightCylinder, along
from wbc.view.scene.ground import GroundSlab
from wbc.view.scene.shapes import LinkShape


@dataclass(frozen=True)
class SceneSize:
    """Lengths that fit a robot, for arrows, hubs and marks.

    Attributes:
        reach: [m] about the robot's size.
        weight: [N] of the robot; an arrow of this force is 0.45 reach long.
    """

    reach: float
    weight: float

    @property
    def metres_per_newton(self) -> float:
        """Length of a force arrow per newton."""
        return 0.45 * self.reach / max(self.weight, 1e-9)

    @property
    def hub(self) -> float:
        """Half the length of the longest disc on a joint [m]."""
        return 0.1 * self.reach

    @property
    def arrow_radius(self) -> float:
        """Of the shaft of a force arrow [m]."""
        return 0.011 * self.reach

    @property
    def arrow_head(self) -> float:
        """Length of the head of a force arrow [m]."""
        return 5.0 * self.arrow_radius


def scene_size(robot: Robot, shapes: tuple[LinkShape, ...]) -> SceneSize:
    """Return the lengths that fit a robot in its neutral pose."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.neutral())
    corners = [
        data.oMi[shape.joint].act(corner) for shape in shapes for corner in (shape.low, shape.high)
    ]
    span = float(np.ptp(np.array(corners), axis=0).max()) if corners else 1.0
    return SceneSize(max(span, 1e-3), robot_weight(robot))


def add_robot(root: Any, shapes: tuple[LinkShape, ...]) -> None:
    """Add one group per joint with the bodies it moves, at `root/j<number>`."""
    for shape in shapes:
        place = root[f"j{shape.joint}"][shape.name]
        place.set_object(shape.geometry, material(shape.colour, 1.0))
        place.set_transform(shape.placement.homogeneous)


def add_hubs(root: Any, robot: Robot, shapes: tuple[LinkShape, ...], size: SceneSize) -> None:
    """Add a disc on the axis of every driven joint, at `root/j<number>/hub`, to be coloured."""
    for joint in robot.transmission.joints:
        number = robot.model.getJointId(joint)
        axis = joint_axis(robot, joint)
        turn = along(axis)
        half = min(_half_width(robot, shapes, number, axis) + 0.012 * size.reach, size.hub)
        hub = UprightCylinder(2.0 * half, 0.034 * size.reach)
        place = root[f"j{number}"]["hub"]
        place.set_object(hub, material(rgb(GREY), 1.0))
        place.set_transform(pin.SE3(turn, np.zeros(3)).homogeneous)


def _half_width(
    robot: Robot, shapes: tuple[LinkShape, ...], number: int, axis: FloatArray
) -> float:
    """Return how far the bodies on both sides of a joint stick out along its axis [m]."""
    parent = int(robot.model.parents[number])
    own = int(np.argmax(np.abs(axis)))
    widths = [
        float(max(abs(shape.low[own]), abs(shape.high[own])))
        for shape in shapes
        if shape.joint in (number, parent) and shape.low[own] <= 0.0 <= shape.high[own]
    ]
    return max(widths, default=0.0)


def add_contact(root: Any, friction: float, size: SceneSize) -> None:
    """Add an arrow of unit length along z and a friction cone, to be placed and scaled."""
    radius = size.arrow_radius
    shaft = UprightCylinder(1.0, radius)
    root["shaft"]["body"].set_object(shaft, material(rgb(GREEN), 1.0))
    root["shaft"]["body"].set_transform(_shift(0.5))
    head = UprightCylinder(size.arrow_head, radiusTop=0.0, radiusBottom=2.6 * radius)
    root["head"]["body"].set_object(head, material(rgb(GREEN), 1.0))
    root["head"]["body"].set_transform(_shift(0.5 * size.arrow_head))
    height = 0.28 * size.reach
    cone = UprightCylinder(height, radiusTop=friction * height, radiusBottom=0.0)
    root["cone"]["body"].set_object(cone, material(rgb(YELLOW), 0.22))
    root["cone"]["body"].set_transform(_shift(0.5 * height))


def add_center_of_mass(root: Any, size: SceneSize) -> None:
    """Add a ball, its shadow point on the ground and the plumb line between them."""
    radius = 0.028 * size.reach
    root["ball"].set_object(mg.Sphere(radius), material(rgb(PURPLE), 1.0))
    root["floor"].set_object(
        UprightCylinder(0.004 * size.reach, radius), material(rgb(PURPLE), 0.9)
    )
    root["line"]["body"].set_object(UprightCylinder(1.0, 0.12 * radius), material(rgb(PURPLE), 0.8))
    root["line"]["body"].set_transform(_shift(0.5))


def add_ground(root: Any, slabs: tuple[GroundSlab, ...], opacity: float) -> None:
    """Add the ground as thin boxes whose upper faces are the surface."""
    for i, slab in enumerate(slabs):
        place = root[f"slab{i}"]
        matt = mg.MeshLambertMaterial(color=0xA9B0BA, opacity=opacity, transparent=opacity < 1.0)
        place.set_object(mg.Box([float(side) for side in slab.sides]), matt)
        place.set_transform(slab.placement.homogeneous)


def add_robot_scene(
    viewer: Any,
    robot: Robot,
    shapes: tuple[LinkShape, ...],
    slabs: tuple[GroundSlab, ...],
    contacts: Sequence[str],
    ground_opacity: float = 1.0,
) -> SceneSize:
    """Add robot, hubs, named contacts, centre of mass and ground to `viewer`; return their size.

    Args:
        viewer: where to add them.
        robot: whose joints and contacts.
        shapes: its bodies, from `robot_shapes`.
        slabs: the ground.
        contacts: names of those with an arrow and a cone.
        ground_opacity: of the ground, in [0, 1].
    """
    size = scene_size(robot, shapes)
    add_robot(viewer["robot"], shapes)
    add_hubs(viewer["robot"], robot, shapes, size)
    for name in contacts:
        add_contact(viewer["contacts"][name], robot.contact(name).friction, size)
    add_center_of_mass(viewer["com"], size)
    add_ground(viewer["ground"], slabs, ground_opacity)
    return size


def material(colour: tuple[float, float, float], opacity: float) -> mg.MeshPhongMaterial:
    """Return a surface of a colour given as red, green, blue in [0, 1]."""
    red, green, blue = (round(255 * part) for part in colour)
    return mg.MeshPhongMaterial(
        color=(red << 16) + (green << 8) + blue,
        opacity=opacity,
        transparent=opacity < 1.0,
        depthWrite=opacity >= 1.0,
        reflectivity=0.1,
    )


def _shift(height: float) -> FloatArray:
    placement = np.eye(4)
    placement[2, 3] = height
    return placement
