"""The robot: bodies, transmission, contacts, effects, and how it is loaded."""

from wbc.robot.body_contacts import body_surfaces
from wbc.robot.description import bare_robot, state_gear
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
from wbc.robot.library import robot_names, robots_directory
from wbc.robot.model import BodySurface, ContactPoint, FreeBody, LinkSolid
from wbc.robot.robot import Robot
from wbc.robot.search import Evidence, Quantity, Screen, SearchOffer

__all__ = [
    "BaseState",
    "BodySurface",
    "ContactForces",
    "ContactPoint",
    "Effect",
    "Evidence",
    "FreeBody",
    "Hook",
    "JointMap",
    "LinkSolid",
    "Memory",
    "MemoryEnergy",
    "Motion",
    "Parameter",
    "Quantity",
    "Robot",
    "Screen",
    "SearchOffer",
    "Usual",
    "bare_robot",
    "body_surfaces",
    "number",
    "robot_names",
    "robots_directory",
    "state_gear",
]
