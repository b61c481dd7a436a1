"""Whole-body control through lossy gears: tasks, contacts, limits, and the controller."""

from wbc.control.command import Command, Status
from wbc.control.contacts import ConeApproximation, Contact, PointContact, SurfaceContact
from wbc.control.controller import Controller
from wbc.control.efforts import (
    ContactForceTask,
    Effort,
    JouleHeatEffort,
    MeshLossEffort,
    OutputTorqueEffort,
    RotorTorqueEffort,
)
from wbc.control.gears import RestPolicy
from wbc.control.limits import JointLimit, RotorTorqueLimit
from wbc.control.reference import Reference
from wbc.control.safety import Damped, Hold, RepeatLast, SafetyPolicy
from wbc.control.settings import ControllerSettings
from wbc.control.speed import SpeedBlend
from wbc.control.state import State
from wbc.control.tasks import (
    AngularMomentumTask,
    CenterOfMassTask,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
    PointFootBalanceTask,
    PostureTask,
    Task,
)

__all__ = [
    "AngularMomentumTask",
    "CenterOfMassTask",
    "Command",
    "ConeApproximation",
    "Contact",
    "ContactForceTask",
    "Controller",
    "ControllerSettings",
    "Damped",
    "Effort",
    "FrameOrientationTask",
    "FramePoseTask",
    "FramePositionTask",
    "Hold",
    "JointLimit",
    "JouleHeatEffort",
    "MeshLossEffort",
    "OutputTorqueEffort",
    "PointContact",
    "PointFootBalanceTask",
    "PostureTask",
    "Reference",
    "RepeatLast",
    "RestPolicy",
    "RotorTorqueEffort",
    "RotorTorqueLimit",
    "SafetyPolicy",
    "SpeedBlend",
    "State",
    "Status",
    "SurfaceContact",
    "Task",
]
