"""Whole-body control through lossy gears: tasks, contacts, limits, and the controller."""

from wbc.control.command import Command, Status
from wbc.control.controller import Controller
from wbc.control.explain import explain
from wbc.control.gears import RestPolicy, SpeedBlend
from wbc.control.policies import LetDown, SafetyPolicy, Situation
from wbc.control.qp.solvers import WarmStart
from wbc.control.reference import Reference, State
from wbc.control.rows.collision import CollisionLimit, Shape
from wbc.control.rows.contacts import ConeApproximation, Contact, PointContact
from wbc.control.rows.efforts import (
    ContactForceTask,
    Effort,
    JouleHeatEffort,
    MeshLossEffort,
    OutputTorqueEffort,
    RotorTorqueEffort,
)
from wbc.control.rows.frame_tasks import (
    FrameDistanceTask,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
)
from wbc.control.rows.limits import JointLimit, MotorBraking, RotorTorqueLimit
from wbc.control.rows.point_foot import PointFootBalanceTask
from wbc.control.rows.posture import PostureTask
from wbc.control.rows.schedule import ContactRamp, ContactSchedule
from wbc.control.rows.surface import SurfaceContact
from wbc.control.rows.task import Task
from wbc.control.rows.whole_body_tasks import (
    AngularMomentumTask,
    CapturePointTask,
    CenterOfMassTask,
    CentroidalMomentumTask,
    LinearMomentumTask,
)
from wbc.control.settings import ControllerSettings, DisturbanceObserver

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
    "DisturbanceObserver",
    "Effort",
    "FrameDistanceTask",
    "FrameOrientationTask",
    "FramePoseTask",
    "FramePositionTask",
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
