"""The robot: bodies, transmission, contacts, effects, and how it is loaded."""

from wbc.robot.contact import ContactPoint
from wbc.robot.effect import (
    ContactForces,
    Effect,
    Hook,
    MemoryEnergy,
    Parameter,
    Quantity,
    small_steps,
)
from wbc.robot.joint_map import BaseState, JointMap
from wbc.robot.loading.description import (
    RobotDescription,
    bare_robot,
    build_robot,
    read_description,
    with_gear_numbers,
)
from wbc.robot.loading.library import find_description, robot_names, robots_directory
from wbc.robot.loading.solids import collision_solids, model_geometry, model_path
from wbc.robot.motion import Memory, Motion
from wbc.robot.mounting import RotorMounting
from wbc.robot.robot import Robot, RobotSource
from wbc.robot.screening import Evidence, Screen

__all__ = [
    "BaseState",
    "ContactForces",
    "ContactPoint",
    "Effect",
    "Evidence",
    "Hook",
    "JointMap",
    "Memory",
    "MemoryEnergy",
    "Motion",
    "Parameter",
    "Quantity",
    "Robot",
    "RobotDescription",
    "RobotSource",
    "RotorMounting",
    "Screen",
    "bare_robot",
    "build_robot",
    "collision_solids",
    "find_description",
    "model_geometry",
    "model_path",
    "read_description",
    "robot_names",
    "robots_directory",
    "small_steps",
    "with_gear_numbers",
]
