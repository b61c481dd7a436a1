"""The robot: bodies, transmission, contacts, effects, and how it is loaded."""

from wbc.robot.body_contacts import body_surfaces as body_surfaces
from wbc.robot.description import bare_robot as bare_robot, state_gear as state_gear
from wbc.robot.effect import (
    ContactForces as ContactForces,
    Effect as Effect,
    Hook as Hook,
    Memory as Memory,
    MemoryEnergy as MemoryEnergy,
    Motion as Motion,
    Parameter as Parameter,
    Usual as Usual,
    number as number,
)
from wbc.robot.joint_map import BaseState as BaseState, JointMap as JointMap
from wbc.robot.library import robot_names as robot_names, robots_directory as robots_directory
from wbc.robot.model import (
    BodySurface as BodySurface,
    ContactPoint as ContactPoint,
    FreeBody as FreeBody,
    LinkSolid as LinkSolid,
)
from wbc.robot.robot import Robot as Robot
from wbc.robot.search import (
    Evidence as Evidence,
    Quantity as Quantity,
    Screen as Screen,
    SearchOffer as SearchOffer,
)
