"""The robot: bodies, transmission, contacts, effects, and how it is loaded."""

from wbc.robot.body_contacts import (
    Hull,
    PlacedGeometry,
    body_contacts,
    body_surfaces,
    collision_solids,
    ground_box,
    hull_of,
    placed_geometry,
)
from wbc.robot.description import (
    RobotDescription,
    bare_robot,
    build_robot,
    read_description,
    state_gear,
    with_gear_numbers,
)
from wbc.robot.effect import (
    ContactForces,
    Effect,
    Hook,
    Memory,
    MemoryEnergy,
    Motion,
    Parameter,
    Usual,
    number,
)
from wbc.robot.joint_map import BaseState, JointMap
from wbc.robot.library import find_description, robot_names, robots_directory
from wbc.robot.model import BodySurface, ContactPoint, FreeBody, LinkSolid, RotorMounting
from wbc.robot.robot import Robot, RobotSource
from wbc.robot.search import Evidence, Quantity, Screen, SearchOffer, usual_cost

__all__ = [
    "BaseState",
    "BodySurface",
    "ContactForces",
    "ContactPoint",
    "Effect",
    "Evidence",
    "FreeBody",
    "Hook",
    "Hull",
    "JointMap",
    "LinkSolid",
    "Memory",
    "MemoryEnergy",
    "Motion",
    "Parameter",
    "PlacedGeometry",
    "Quantity",
    "Robot",
    "RobotDescription",
    "RobotSource",
    "RotorMounting",
    "Screen",
    "SearchOffer",
    "Usual",
    "bare_robot",
    "body_contacts",
    "body_surfaces",
    "build_robot",
    "collision_solids",
    "find_description",
    "ground_box",
    "hull_of",
    "number",
    "placed_geometry",
    "read_description",
    "robot_names",
    "robots_directory",
    "state_gear",
    "usual_cost",
    "with_gear_numbers",
]
