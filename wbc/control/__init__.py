"""Whole-body control through lossy gears: tasks, contacts, limits, and the controller."""

from wbc.control.command import Command, Status, explain
from wbc.control.controller import Controller
from wbc.control.inputs import Reference, State
from wbc.control.qp.solvers import WarmStart
from wbc.control.rows.collision import CollisionLimit, Shape
from wbc.control.rows.contacts import Contact, PointContact, SurfaceContact
from wbc.control.rows.efforts import (
    Effort,
    JouleHeatEffort,
    MeshLossEffort,
    OutputTorqueEffort,
    RotorTorqueEffort,
)
from wbc.control.rows.limits import JointLimit, RotorTorqueLimit
from wbc.control.rows.motions import (
    AngularMomentumTask,
    CapturePointTask,
    CenterOfMassTask,
    CentroidalMomentumTask,
    FrameDistanceTask,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
    LinearMomentumTask,
    PostureTask,
)
from wbc.control.rows.point_foot import PointFootBalanceTask
from wbc.control.rows.schedule import ContactRamp, ContactSchedule
from wbc.control.rows.task import Task
from wbc.control.settings import (
    ControllerSettings,
    DisturbanceObserver,
    LetDown,
    RestPolicy,
    SpeedBlend,
)

__all__ = [
    "AngularMomentumTask",
    "CapturePointTask",
    "CenterOfMassTask",
    "CentroidalMomentumTask",
    "CollisionLimit",
    "Command",
    "Contact",
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
    "OutputTorqueEffort",
    "PointContact",
    "PointFootBalanceTask",
    "PostureTask",
    "Reference",
    "RestPolicy",
    "RotorTorqueEffort",
    "RotorTorqueLimit",
    "Shape",
    "SpeedBlend",
    "State",
    "Status",
    "SurfaceContact",
    "Task",
    "WarmStart",
    "explain",
]
