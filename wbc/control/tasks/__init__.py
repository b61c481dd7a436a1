"""Tasks: what the robot should do, each a value with error, Jacobian and drift."""

from wbc.control.tasks.balance.capture_point import CapturePointTask
from wbc.control.tasks.balance.point_foot_balance import PointFootBalanceTask
from wbc.control.tasks.center_of_mass import CenterOfMassTask
from wbc.control.tasks.frames.frame_distance import FrameDistanceTask
from wbc.control.tasks.frames.frame_orientation import FrameOrientationTask
from wbc.control.tasks.frames.frame_pose import FramePoseTask
from wbc.control.tasks.frames.frame_position import FramePositionTask
from wbc.control.tasks.frames.gaze import GazeTask
from wbc.control.tasks.momentum.angular_momentum import AngularMomentumTask
from wbc.control.tasks.momentum.centroidal_momentum import CentroidalMomentumTask
from wbc.control.tasks.momentum.linear_momentum import LinearMomentumTask
from wbc.control.tasks.posture import PostureTask
from wbc.control.tasks.task import Task

__all__ = [
    "AngularMomentumTask",
    "CapturePointTask",
    "CenterOfMassTask",
    "CentroidalMomentumTask",
    "FrameDistanceTask",
    "FrameOrientationTask",
    "FramePoseTask",
    "FramePositionTask",
    "GazeTask",
    "LinearMomentumTask",
    "PointFootBalanceTask",
    "PostureTask",
    "Task",
]
