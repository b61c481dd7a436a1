"""What the columns of logs hold, told by a robot: checks, mistakes, and what the torque is."""

from wbc.identification.readings.checks import check_log, check_logs
from wbc.identification.readings.mistakes import find_suspicions, suspicions
from wbc.identification.readings.robot_checks import check_robot, moving_contact, refusal
from wbc.identification.readings.torque import (
    feedback_torques,
    joint_position,
    makes_torque,
    reports_current,
    reports_torque,
    rotor_torques,
    with_machine,
    without_position,
)

__all__ = [
    "check_log",
    "check_logs",
    "check_robot",
    "feedback_torques",
    "find_suspicions",
    "joint_position",
    "makes_torque",
    "moving_contact",
    "refusal",
    "reports_current",
    "reports_torque",
    "rotor_torques",
    "suspicions",
    "with_machine",
    "without_position",
]
