"""What the columns of logs hold, told by a robot: checks, mistakes, and what the torque is."""

from wbc.identification.readings.checks import (
    LogQuality,
    check_log,
    check_logs,
    check_robot,
    refusal,
)
from wbc.identification.readings.mistakes import SuspiciousLogError, find_suspicions, suspicions
from wbc.identification.records.channels import (
    feedback_torques,
    joint_position,
    rotor_torques,
    tells_torque,
    torque_sources,
    with_machine,
    without_position,
)
from wbc.measurement.checks import find_duplicates, find_repeats

__all__ = [
    "LogQuality",
    "SuspiciousLogError",
    "check_log",
    "check_logs",
    "check_robot",
    "feedback_torques",
    "find_duplicates",
    "find_repeats",
    "find_suspicions",
    "joint_position",
    "refusal",
    "rotor_torques",
    "suspicions",
    "tells_torque",
    "torque_sources",
    "with_machine",
    "without_position",
]
