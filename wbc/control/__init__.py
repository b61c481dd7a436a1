"""Whole-body control through lossy gears: tasks, contacts, limits, and the controller."""

from wbc.control.collision import CollisionLimit, Shape
from wbc.control.command import Command, Status
from wbc.control.contacts import ConeApproximation, Contact, PointContact
from wbc.control.controller import Controller
from wbc.control.drivetrain import DisturbanceObserver
from wbc.control.efforts import (
    ContactForceTask,
    Effort,
    JouleHeatEffort,
    MeshLossEffort,
    OutputTorqueEffort,
    RotorTorqueEffort,
)
from wbc.control.explain import explain
from wbc.control.frame_tasks import (
    FrameDistanceTask,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
    GazeTask,
)
from wbc.control.gears import RestPolicy
from wbc.control.limits import JointLimit, MotorBraking, RotorTorqueLimit
from wbc.control.point_foot import PointFootBalanceTask
from wbc.control.policies import Damped, Hold, LetDown, RepeatLast, SafetyPolicy, Situation
from wbc.control.posture import PostureTask
from wbc.control.reference import Reference, State
from wbc.control.schedule import ContactRamp, ContactSchedule
from wbc.control.settings import ControllerSettings
from wbc.control.solvers import WarmStart
from wbc.control.speed import SpeedBlend
from wbc.control.surface import SurfaceContact
from wbc.control.task import Task
from wbc.control.whole_body_tasks import (
    AngularMomentumTask,
    CapturePointTask,
    CenterOfMassTask,
    CentroidalMomentumTask,
    LinearMomentumTask,
)

__all__ = [
    "AngularMomentumTask",
    "CapturePointTask",
    "CenterOfMassTask",
    "CentroidalMomentumTask",
    "CollisionLimit",
    "Command",
    "ConeApproximation",
    "Contact",
    "ContactForceTask",
    "ContactRamp",
    "ContactSchedule",
    "Controller",
    "ControllerSettings",
    "Damped",
    "DisturbanceObserver",
    "Effort",
    "FrameDistanceTask",
    "FrameOrientationTask",
    "FramePoseTask",
    "FramePositionTask",
    "GazeTask",
    "Hold",
    "JointLimit",
    "JouleHeatEffort",
    "LetDown",
    "LinearMomentumTask",
    "MeshLossEffort",
    "MotorBraking",
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
    "Shape",
    "Situation",
    "SpeedBlend",
    "State",
    "Status",
    "SurfaceContact",
    "Task",
    "WarmStart",
    "explain",
]
