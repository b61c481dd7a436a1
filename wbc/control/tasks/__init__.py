"""Tasks: what the robot should do, each a value with error, Jacobian and drift."""

from wbc.control.tasks.angular_momentum import AngularMomentumTask
from wbc.control.tasks.center_of_mass import CenterOfMassTask
from wbc.control.tasks.centroidal_momentum import CentroidalMomentumTask
from wbc.control.tasks.frame_orientation import FrameOrientationTask
from wbc.control.tasks.frame_pose import FramePoseTask
from wbc.control.tasks.frame_position import FramePositionTask
from wbc.control.tasks.linear_momentum import LinearMomentumTask
from wbc.control.tasks.point_foot_balance import PointFootBalanceTask
from wbc.control.tasks.posture import PostureTask
from wbc.control.tasks.task import Task

__all__ = [
    "AngularMomentumTask",
    "CenterOfMassTask",
    "CentroidalMomentumTask",
    "FrameOrientationTask",
    "FramePoseTask",
    "FramePositionTask",
    "LinearMomentumTask",
    "PointFootBalanceTask",
    "PostureTask",
    "Task",
]
