"""The robot: bodies, transmission, contacts, effects, and how it is loaded."""

from wbc.robot.body_contacts import body_surfaces as body_surfaces
from wbc.robot.coordinates import BaseState as BaseState, JointMap as JointMap
from wbc.robot.description import (
    bare_robot as bare_robot,
    robot_names as robot_names,
    robots_directory as robots_directory,
    state_gear as state_gear,
)
from wbc.robot.effect import (
    Effect as Effect,
    Evidence as Evidence,
    Hook as Hook,
    Memory as Memory,
    MemoryEnergy as MemoryEnergy,
    Motion as Motion,
    Parameter as Parameter,
    Quantity as Quantity,
    Screen as Screen,
    SearchOffer as SearchOffer,
    Usual as Usual,
    number as number,
)
from wbc.robot.robot import (
    BodySurface as BodySurface,
    ContactPoint as ContactPoint,
    FreeBody as FreeBody,
    LinkSolid as LinkSolid,
    Robot as Robot,
)
