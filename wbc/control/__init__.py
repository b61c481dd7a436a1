"""Whole-body control through lossy gears: tasks, contacts, limits, and the controller."""

from wbc.control.command import Command as Command, Status as Status, explain as explain
from wbc.control.inputs import Reference as Reference, State as State
from wbc.control.qp.solvers import WarmStart as WarmStart
from wbc.control.rows.collision import CollisionLimit as CollisionLimit, Shape as Shape
from wbc.control.rows.contacts import (
    Contact as Contact,
    ContactRamp as ContactRamp,
    ContactSchedule as ContactSchedule,
    PointContact as PointContact,
    SurfaceContact as SurfaceContact,
)
from wbc.control.rows.limits import (
    Effort as Effort,
    JointLimit as JointLimit,
    JouleHeatEffort as JouleHeatEffort,
    MeshLossEffort as MeshLossEffort,
    OutputTorqueEffort as OutputTorqueEffort,
    RotorTorqueEffort as RotorTorqueEffort,
    RotorTorqueLimit as RotorTorqueLimit,
)
from wbc.control.rows.tasks import (
    AngularMomentumTask as AngularMomentumTask,
    CapturePointTask as CapturePointTask,
    CenterOfMassTask as CenterOfMassTask,
    CentroidalMomentumTask as CentroidalMomentumTask,
    FrameDistanceTask as FrameDistanceTask,
    FrameOrientationTask as FrameOrientationTask,
    FramePoseTask as FramePoseTask,
    FramePositionTask as FramePositionTask,
    LinearMomentumTask as LinearMomentumTask,
    PointFootBalanceTask as PointFootBalanceTask,
    PostureTask as PostureTask,
    Task as Task,
)
from wbc.control.settings import (
    ControllerSettings as ControllerSettings,
    DisturbanceObserver as DisturbanceObserver,
    LetDown as LetDown,
    RestPolicy as RestPolicy,
    SpeedBlend as SpeedBlend,
)
from wbc.control.tick import Controller as Controller
