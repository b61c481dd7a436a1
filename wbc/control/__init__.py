"""Whole-body control through lossy gears: tasks, contacts, limits, and the controller."""

from wbc.control.command import Command, Status
from wbc.control.contacts import ConeApproximation, Contact, PointContact, SurfaceContact
from wbc.control.contacts.contact_ramp import ContactRamp
from wbc.control.controller import Controller
from wbc.control.disturbance import DisturbanceObserver
from wbc.control.efforts import (
    ContactForceTask,
    Effort,
    JouleHeatEffort,
    MeshLossEffort,
    OutputTorqueEffort,
    RotorTorqueEffort,
)
from wbc.control.limits import JointLimit, MotorBraking, RotorTorqueLimit
from wbc.control.reference import Reference
from wbc.control.safety.explain import explain
from wbc.control.safety.policies import (
    Damped,
    Hold,
    LetDown,
    RepeatLast,
    SafetyPolicy,
    Situation,
)
from wbc.control.settings import ControllerSettings
from wbc.control.solvers.warm_start import WarmStart
from wbc.control.state import State
from wbc.control.tasks import (
    AngularMomentumTask,
    CenterOfMassTask,
    CentroidalMomentumTask,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
    LinearMomentumTask,
    PointFootBalanceTask,
    PostureTask,
    Task,
)
from wbc.control.torque.gears import RestPolicy
from wbc.control.torque.speed import SpeedBlend

__all__ = [
    "AngularMomentumTask",
    "CenterOfMassTask",
    "CentroidalMomentumTask",
    "Command",
    "ConeApproximation",
    "Contact",
    "ContactForceTask",
    "ContactRamp",
    "Controller",
    "ControllerSettings",
    "Damped",
    "DisturbanceObserver",
    "Effort",
    "FrameOrientationTask",
    "FramePoseTask",
    "FramePositionTask",
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
    "Situation",
    "SpeedBlend",
    "State",
    "Status",
    "SurfaceContact",
    "Task",
    "WarmStart",
    "explain",
]
