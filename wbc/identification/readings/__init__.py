"""What the columns of logs hold, told by a robot: checks, mistakes, and what the torque is."""

from wbc.identification.readings.checks import LogQuality, check_log, check_logs, check_robot
from wbc.identification.readings.mistakes import SuspiciousLogError, find_suspicions, suspicions
from wbc.identification.records.channels import with_machine
from wbc.measurement.checks import find_repeats

__all__ = [
    "LogQuality",
    "SuspiciousLogError",
    "check_log",
    "check_logs",
    "check_robot",
    "find_repeats",
    "find_suspicions",
    "suspicions",
    "with_machine",
]
